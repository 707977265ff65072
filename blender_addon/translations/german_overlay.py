"""What is drawn over viewports, and the preview in them, in German."""

MESSAGES = {
    "Playable": {
        "Overlay": "Überlagerung",
        "Ground Grid": "Bodenraster",
        "Volumes": "Volumen",
        "Ground Points": "Bodenpunkte",
        "Steps": "Schritte",
        "Actions": "Aktionen",
        "Headings": "Blickrichtungen",
        "Players": "Spieler",
        "Ghosts": "Geister",
        "Boxes": "Rahmen",
        "Paths": "Pfade",
    },
    "*": {
        "Draw the environment's marks in 3D viewports": (
            "Die Hilfslinien der Umgebung in 3D-Ansichtsfenstern zeichnen"
        ),
        "Playing": "Spiel",
        "The ground on which the model knows players, in whole metres": (
            "Der Boden, auf dem das Modell Spieler kennt, in ganzen Metern"
        ),
        "The boxes of the players in the picture, with what is wrong with them": (
            "Die Rahmen der Spieler im Bild und was an ihnen nicht stimmt"
        ),
        "Where the players will stand, as the boxes say": (
            "Wo die Spieler stehen werden, den Rahmen nach"
        ),
        "The points that place the camera, and by how much they miss": (
            "Die Punkte, die die Kamera festlegen, und um wie viel sie danebenliegen"
        ),
        "The ways that the players are going to take": "Die Wege, die die Spieler nehmen werden",
        "A dot at every step of the model": "Ein Punkt bei jedem Schritt des Modells",
        "The names of actions where they begin": "Die Namen der Aktionen, wo sie beginnen",
        "Where players who turn are looking": "Wohin Spieler blicken, die sich drehen",
        "The volume of every player in its colour, with its name": (
            "Das Volumen jedes Spielers in seiner Farbe, mit seinem Namen"
        ),
        "The players' volumes at steps before and after the current frame": (
            "Die Volumen der Spieler bei Schritten vor und nach dem aktuellen Einzelbild"
        ),
        "Before": "Davor",
        "Ghosts behind each player": "Geister hinter jedem Spieler",
        "After": "Danach",
        "Ghosts ahead of each player": "Geister vor jedem Spieler",
        "Every": "Alle",
        "Steps of the model from one ghost to the next": (
            "Schritte des Modells von einem Geist zum nächsten"
        ),
        "Rendered shading needs a perspective view: press 5 on the number pad, or 0 for the "
        "camera": (
            "Gerendertes Shading braucht eine perspektivische Ansicht: Numpad 5 drücken, oder 0 "
            "für die Kamera"
        ),
        "Rendering; the preview goes on afterwards": (
            "Es wird gerendert; danach geht die Vorschau weiter"
        ),
        "The camera's background picture covers the preview; switch it off in the camera's "
        "properties": (
            "Das Hintergrundbild der Kamera verdeckt die Vorschau; in den Eigenschaften der "
            "Kamera ausschalten"
        ),
    },
}
