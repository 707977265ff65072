"""Where the add-on's panels stand."""


class PlayablePanel:
    """A panel of the tab *Playable* in the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Playable"
