"""What differs from the prediction, in German."""

MESSAGES = {
    "Operator": {
        "Add Style from Picture": "Stil aus Bild hinzufügen",
        "Add Styles from Scene": "Stile aus Szene hinzufügen",
        "Export Shot": "Shot exportieren",
        "Follow Again": "Wieder folgen",
        "Follow the Path Again": "Dem Pfad wieder folgen",
        "Free Pose": "Pose freigeben",
        "Hold Pose": "Pose halten",
        "Leave the Path": "Pfad verlassen",
        "Playable Environment Shot (.json)": "Shot einer spielbaren Umgebung (.json)",
        "Remove Style": "Stil entfernen",
    },
    "*": {
        "Overrides": "Überschreibungen",
        "Whether it follows its predicted path. Its own keys of location and rotation count in "
        "every frame that is drawn; while it is free, baking does not replace them": (
            "Ob es seinem vorhergesagten Pfad folgt. Seine eigenen Schlüsselbilder für Position "
            "und Rotation zählen in jedem gezeichneten Einzelbild; solange es frei ist, ersetzt "
            "das Backen sie nicht"
        ),
        "Follow the Path": "Dem Pfad folgen",
        "Stands where the model predicts; baking keys its path": (
            "Steht, wo das Modell es vorhersagt; das Backen setzt seinen Pfad als Schlüsselbilder"
        ),
        "Free": "Frei",
        "Stands where its own location and rotation keys put it; baking leaves those keys alone": (
            "Steht, wo seine eigenen Schlüsselbilder für Position und Rotation es hinstellen; das "
            "Backen lässt sie in Ruhe"
        ),
        "Style": "Stil",
        "Whose look it has": "Wessen Aussehen es hat",
        "Own": "Eigener",
        "Looks as in the environment's picture": "Sieht aus wie im Bild der Umgebung",
        "From Object": "Vom Objekt",
        "Takes on the look of another object of the picture": (
            "Nimmt das Aussehen eines anderen Objekts des Bildes an"
        ),
        "From Picture": "Vom Bild",
        "Takes on the look of an object in another picture": (
            "Nimmt das Aussehen eines Objekts in einem anderen Bild an"
        ),
        "The object of the same class that lends its look": (
            "Das Objekt derselben Klasse, dessen Aussehen übernommen wird"
        ),
        "The style from another picture; add them under Styles": (
            "Der Stil aus einem anderen Bild; hinzufügen unter „Stile“"
        ),
        "Mix": "Mischen",
        "How much of the other look it takes on: 0 keeps its own, 1 is all the other's": (
            "Wie viel es vom anderen Aussehen annimmt: 0 behält das eigene, 1 ist ganz das andere"
        ),
        "Held keeps the pose that was predicted for the frame of the first Held key; without "
        "keys, that of the first baked frame": (
            "„Gehalten“ behält die Pose, die für das erste so gesetzte Schlüsselbild vorhergesagt "
            "wurde; ohne Schlüsselbilder die des ersten gebackenen Einzelbilds"
        ),
        "Moves its limbs as the model predicts": (
            "Bewegt seine Glieder, wie das Modell es vorhersagt"
        ),
        "Held": "Gehalten",
        "Keeps the pose of the frame where holding begins, wherever it goes": (
            "Behält die Pose des Einzelbilds, in dem das Halten beginnt, wohin es auch geht"
        ),
        "Key the active object's pose at this frame: held as it is now, or free again": (
            "Für die Pose des aktiven Objekts hier ein Schlüsselbild setzen: gehalten, wie sie "
            "ist, oder wieder frei"
        ),
        "Hold": "Halten",
        "Hold the pose; off lets it move again": (
            "Die Pose halten; aus lässt sie sich wieder bewegen"
        ),
        "Keep the pose of this frame from here on, wherever the object goes (keys Held)": (
            "Die Pose dieses Einzelbilds ab hier behalten, wohin das Objekt auch geht (setzt "
            "„Gehalten“)"
        ),
        "Let the limbs move as the model predicts from here on (keys Free)": (
            "Die Glieder ab hier wieder bewegen, wie das Modell es vorhersagt (setzt „Frei“)"
        ),
        "It is linked from another file; make a library override": (
            "Es ist aus einer anderen Datei verknüpft; eine Bibliotheks-Überschreibung anlegen"
        ),
        "Show in Renders": "Rendern",
        "From this frame to its next Follow key, let the active object stand where its own keys "
        "of location and rotation put it; baking leaves those keys alone": (
            "Das aktive Objekt von diesem Einzelbild bis zu seinem nächsten Schlüsselbild „Dem "
            "Pfad folgen“ dort stehen lassen, wo seine eigenen Schlüsselbilder für Position und "
            "Rotation es hinstellen; das Backen lässt sie in Ruhe"
        ),
        "Put the active object back on the path that was baked for it": (
            "Das aktive Objekt auf den Pfad zurückstellen, der für es gebacken wurde"
        ),
        "Frames": "Einzelbilder",
        "Where its own keys give way to the path": (
            "Wo seine eigenen Schlüsselbilder dem Pfad weichen"
        ),
        "At This Frame": "In diesem Einzelbild",
        "Only at the current frame": "Nur im aktuellen Einzelbild",
        "From Here On": "Ab hier",
        "From the current frame to the end of the baked range": (
            "Vom aktuellen Einzelbild bis zum Ende des gebackenen Bereichs"
        ),
        "At All Frames": "In allen Einzelbildern",
        "Forget every key of location and turn, and where it was free": (
            "Alle Schlüsselbilder für Position und Drehung vergessen, und wo es frei war"
        ),
        "Styles": "Stile",
        "Active Style": "Aktiver Stil",
        "The style that Remove Style takes away": "Der Stil, den „Stil entfernen“ wegnimmt",
        "The other picture, encoded, as JSON": "Das andere Bild, kodiert, als JSON",
        "The object of that picture": "Das Objekt jenes Bildes",
        "The model that encoded it": "Das Modell, das es kodiert hat",
        "Another picture, in which somebody looks as wanted": (
            "Ein anderes Bild, in dem jemand aussieht wie gewünscht"
        ),
        "Another scene with an environment of the same model": (
            "Eine andere Szene mit einer Umgebung desselben Modells"
        ),
        "Which playable object of the model is seen there; none: the active Empty's": (
            "Welches spielbare Objekt des Modells dort zu sehen ist; keines: das des aktiven Empty"
        ),
        "Where it is in that picture: left, top, right, bottom in pixels. All zero: it is "
        "looked for, where a detector is installed": (
            "Wo es in jenem Bild ist: links, oben, rechts, unten in Pixeln. Alles null: es wird "
            "gesucht, wenn ein Detektor installiert ist"
        ),
        "Which camera saw that picture": "Mit welcher Kamera jenes Bild aufgenommen wurde",
        "Such pictures are usually taken from there": (
            "Solche Bilder werden gewöhnlich von dort aufgenommen"
        ),
        "Encode another picture and collect how its object looks, for players to take on": (
            "Ein anderes Bild kodieren und das Aussehen seines Objekts sammeln, damit Spieler es "
            "annehmen können"
        ),
        "Collect how the players of another scene's environment look": (
            "Das Aussehen der Spieler aus der Umgebung einer anderen Szene sammeln"
        ),
        "Choose another scene first": "Zuerst eine andere Szene wählen",
        "Remove the active style from the list; objects that wear it get their own look back": (
            "Den aktiven Stil aus der Liste entfernen; Objekte, die ihn tragen, bekommen ihr "
            "eigenes Aussehen zurück"
        ),
        "There is no style to remove": "Es gibt keinen Stil zu entfernen",
        "Its style in this environment's picture": "Sein Stil im Bild dieser Umgebung",
        "A style from another picture": "Ein Stil aus einem anderen Bild",
        "The other picture shows it": "Das andere Bild zeigt es",
        "Nothing is chosen yet: the style stays its own": (
            "Noch nichts gewählt: der Stil bleibt der eigene"
        ),
        "Shot File": "Shot-Datei",
        "The shot file; encoded pictures go beside it": (
            "Die Shot-Datei; kodierte Bilder kommen daneben"
        ),
        "Write the baked range with its camera and overrides as a shot file, and the encoded "
        "pictures beside it: pe render draws the same frames without Blender": (
            "Den gebackenen Bereich mit Kamera und Überschreibungen als Shot-Datei schreiben, die "
            "kodierten Bilder daneben: pe render zeichnet dieselben Einzelbilder ohne Blender"
        ),
    },
}
