"""Playing on the timeline, in German."""

MESSAGES = {
    "Operator": {
        "Actions from Clip": "Aktionen aus Clip",
        "Bake Paths": "Pfade backen",
        "Bring Back": "Zurückholen",
        "Delete Action Key": "Aktions-Schlüsselbild löschen",
        "Delete Key": "Schlüsselbild löschen",
        "Do Action": "Aktion ausführen",
        "Insert Action Key": "Aktions-Schlüsselbild einfügen",
        "Jump to Action Key": "Zum Aktions-Schlüsselbild springen",
        "Let It Stand for": "Stehen für",
        "Make Not Playable": "Nicht mehr spielbar",
        "Next Playable Object": "Nächstes spielbares Objekt",
    },
    "Playable": {
        "Action": "Aktion",
    },
    "*": {
        "Playable Object": "Spielbares Objekt",
        "This Empty stands for a playable object": "Dieses Empty steht für ein spielbares Objekt",
        "The playable object's name in the model": "Der Name des spielbaren Objekts im Modell",
        "Action": "Aktion",
        "What the object does from this frame to the next key": (
            "Was das Objekt von diesem Einzelbild bis zum nächsten Schlüsselbild tut"
        ),
        "What the object does from this frame on": "Was das Objekt ab diesem Einzelbild tut",
        "Number of the action, from 0": "Nummer der Aktion, ab 0",
        "{action}: from this frame to the next key": (
            "{action}: von diesem Einzelbild bis zum nächsten Schlüsselbild"
        ),
        "The model has no such action": "Das Modell hat keine solche Aktion",
        "No key at this frame": "Kein Schlüsselbild hier",
        "No action keys yet": "Noch keine Schlüsselbilder",
        "{other} stands for {name} too": "{other} steht auch für {name}",
        "{name} has no Empty and rests": "{name} hat kein Empty und ruht",
        "Let the active playable object do an action from this frame to its next key": (
            "Das aktive spielbare Objekt von diesem Einzelbild bis zu seinem nächsten "
            "Schlüsselbild etwas tun lassen"
        ),
        "Let the selected playable objects do an action from this frame to their next keys": (
            "Die ausgewählten spielbaren Objekte von diesem Einzelbild bis zu ihren nächsten "
            "Schlüsselbildern etwas tun lassen"
        ),
        "Delete the action keys of the selected playable objects at this frame": (
            "Die Aktions-Schlüsselbilder der ausgewählten spielbaren Objekte in diesem Einzelbild "
            "löschen"
        ),
        "There is no action key at this frame": (
            "In diesem Einzelbild ist kein Aktions-Schlüsselbild"
        ),
        "Go to the next or the previous action key of the selected playable objects": (
            "Zum nächsten oder vorigen Aktions-Schlüsselbild der ausgewählten spielbaren Objekte "
            "gehen"
        ),
        "Go to the next key": "Zum nächsten Schlüsselbild gehen",
        "Go to the previous key": "Zum vorigen Schlüsselbild gehen",
        "Next": "Weiter",
        "To the next key, not the previous one": "Zum nächsten Schlüsselbild statt zum vorigen",
        "Select the next playable object, so that the number keys play it": (
            "Das nächste spielbare Objekt auswählen, sodass die Zifferntasten es spielen"
        ),
        "Let this Empty stand for another playable object, for which nobody stands yet": (
            "Dieses Empty für ein anderes spielbares Objekt stehen lassen, das noch kein Empty hat"
        ),
        "Let it stand for {name}": "Für {name} stehen lassen",
        "Every playable object of the picture has its Empty": (
            "Jedes spielbare Objekt des Bildes hat sein Empty"
        ),
        "Let this Empty stand for nobody; it keeps its keys": (
            "Dieses Empty für niemanden mehr stehen lassen; seine Schlüsselbilder bleiben"
        ),
        "Make the Empty of a playable object again, where the picture shows the object": (
            "Das Empty eines spielbaren Objekts wieder dort anlegen, wo das Bild das Objekt zeigt"
        ),
        "Paths": "Pfade",
        "Baked: frames {first} to {last}": "Gebacken: {first} bis {last}",
        "Bake": "Backen",
        "The baked shot and its paths, as JSON": "Der gebackene Shot und seine Pfade als JSON",
        "Let the model act out the action keys, seen by the animated camera, and key the paths": (
            "Das Modell die Aktions-Schlüsselbilder vor der animierten Kamera ausspielen lassen "
            "und die Pfade als Schlüsselbilder setzen"
        ),
        "Update Paths Automatically": "Pfade von selbst nachführen",
        "After an action key, the camera, the range or the pace was changed, let the model act "
        "it out again from that frame on and key the new paths": (
            "Wenn ein Aktions-Schlüsselbild, die Kamera, der Bereich oder das Tempo geändert "
            "wurde, das Modell ab dort neu spielen lassen und die neuen Pfade als Schlüsselbilder "
            "setzen"
        ),
        "Updating the paths": "Pfade werden nachgeführt",
        "Find out what the players of a clip do, step by step, and key it; other keys there go": (
            "Herausfinden, was die Spieler eines Clips Schritt für Schritt tun, und es als "
            "Schlüsselbilder setzen; andere dort entfallen"
        ),
        "From": "Von",
        "Where the pictures come from": "Woher die Bilder kommen",
        "The active movie or image strip, or the topmost one, that shows all along": (
            "Der aktive oder der oberste Film- oder Bildstreifen, der durchgehend zu sehen ist"
        ),
        "Movie Clip": "Filmclip",
        "The movie clip with the tracking markers": "Der Filmclip mit den Tracking-Markern",
        "looking at the pictures": "Bilder werden angesehen",
        "finding the actions": "Aktionen werden gesucht",
    },
}
