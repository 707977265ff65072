"""From a picture to an environment, in German."""

MESSAGES = {
    "Operator": {
        "Add Ground Point": "Bodenpunkt hinzufügen",
        "Boxes from Tracks": "Rahmen aus Spuren",
        "Detect": "Erkennen",
        "Draw Boxes": "Einrahmen",
        "Known Place": "Bekannter Ort",
        "Load Model": "Modell laden",
        "Match Camera": "Kamera einmessen",
        "New in New Scene": "Neu in neuer Szene",
        "Place Points": "Punkte setzen",
        "Remove Ground Point": "Bodenpunkt entfernen",
        "Show Picture": "Bild zeigen",
        "Use Picture Size": "Größe des Bildes verwenden",
    },
    "Playable": {
        "Camera": "Kamera",
        "Usual": "Üblich",
        "Match": "Punkte",
        "Scene": "Szene",
        "Field of View": "Sichtfeld",
    },
    "*": {
        "1   Picture": "1   Bild",
        "2   Camera": "2   Kamera",
        "3   Objects": "3   Objekte",
        "From Tracking Markers": "Aus Tracking-Markern",
        "Good to know before encoding:": "Vor dem Kodieren zu beachten:",
        "{size}, {steps} steps a second": "{size}, {steps} Schritte je Sekunde",
        "Weights: {licence}": "Gewichte: {licence}",
        "{strip}, frame {frame}": "{strip}, Einzelbild {frame}",
        "Residual {pixels} px": "Restfehler {pixels} px",
        "Residual {pixels} px: check points": "Restfehler {pixels} px: Punkte prüfen",
        "Points have moved: match again": "Punkte verschoben: neu einmessen",
        "The model's usual view": "Übliche Ansicht des Modells",
        "Ground X": "Boden X",
        "Pixel X": "Pixel X",
        "Left": "Links",
        "Top": "Oben",
        "Right": "Rechts",
        "Bottom": "Unten",
        "placed": "gesetzt",
        "not placed": "nicht gesetzt",
        "Choose a model file": "Eine Modelldatei wählen",
        "Choose an Image": "Einen Bild-Datenblock wählen",
        "Choose a picture": "Ein Bild wählen",
        "Choose a camera of the scene": "Eine Kamera der Szene wählen",
        "Move the sequencer's playhead onto a movie or image strip": (
            "Den Abspielkopf des Sequenzers auf einen Film- oder Bildstreifen stellen"
        ),
        "The picture's file is gone: choose another": (
            "Die Bilddatei ist nicht mehr da: eine andere wählen"
        ),
        "The model has no usual camera: match one": (
            "Das Modell hat keine übliche Kamera: eine einmessen"
        ),
        "The scene's frame has another shape than the picture: use the picture's size": (
            "Das Format der Szene passt nicht zum Bild: die Größe des Bildes verwenden"
        ),
        "Place {count} or more points of the ground": "Mindestens {count} Punkte des Bodens setzen",
        "Say where {point} lies on the ground; {other} lies there already": (
            "Angeben, wo {point} auf dem Boden liegt; dort liegt schon {other}"
        ),
        "Draw, find or type the box of one playable object or more": (
            "Den Rahmen mindestens eines spielbaren Objekts zeichnen, erkennen lassen oder "
            "eintippen"
        ),
        "Draw the box of {name} again: it is empty or outside of the picture": (
            "Den Rahmen von {name} neu zeichnen: er ist leer oder liegt außerhalb des Bildes"
        ),
        "Comes with the runtime": "Gehört zur Laufzeitumgebung",
        "A model file that you have trained or imported": (
            "Eine selbst trainierte oder importierte Modelldatei"
        ),
        "An image file": "Eine Bilddatei",
        "An Image of this file: painted, packed or generated": (
            "Ein Bild-Datenblock dieser Datei: gemalt, gepackt oder erzeugt"
        ),
        "The movie or image strip under the sequencer's playhead": (
            "Der Film- oder Bildstreifen unter dem Abspielkopf des Sequenzers"
        ),
        "Where pictures of the model's world are usually taken from": (
            "Wo Bilder aus der Welt des Modells gewöhnlich aufgenommen werden"
        ),
        "Found from four or more points of the ground that you place": (
            "Aus mindestens vier gesetzten Punkten des Bodens berechnet"
        ),
        "A camera of this scene, such as a tracked one": (
            "Eine Kamera dieser Szene, zum Beispiel eine getrackte"
        ),
        "Duel": "Duell",
        "The model that knows how such a world looks and moves": (
            "Das Modell, das weiß, wie eine solche Welt aussieht und sich bewegt"
        ),
        "A built-in model's name or a model file, such as pe import-official writes": (
            "Name eines eingebauten Modells oder eine Modelldatei, wie sie pe import-official "
            "schreibt"
        ),
        "Pixels of the pictures that the model was made for": (
            "Pixel der Bilder, für die das Modell gemacht ist"
        ),
        "Licence": "Lizenz",
        "Terms of the model's weights": "Bedingungen für die Gewichte des Modells",
        "Steps per Second": "Schritte je Sekunde",
        "The pace at which the model moves": "Das Tempo, in dem sich das Modell bewegt",
        "The picture that became this environment": (
            "Das Bild, aus dem diese Umgebung entstanden ist"
        ),
        "Where the picture comes from": "Woher das Bild kommt",
        "The Image that becomes an environment": "Der Bild-Datenblock, aus dem eine Umgebung wird",
        "Backdrop": "Kulisse",
        "The picture behind the camera": "Das Hintergrundbild der Kamera",
        "The camera that saw the picture; empty: the scene's active one": (
            "Die Kamera, die das Bild aufgenommen hat; leer: die aktive der Szene"
        ),
        "Own Camera": "Eigene Kamera",
        "The camera that was made for the picture": "Die Kamera, die für das Bild angelegt wurde",
        "Pixel": "Pixel",
        "Where the picture shows it, from the upper left corner": (
            "Wo es im Bild zu sehen ist, von der linken oberen Ecke aus"
        ),
        "Placed": "Gesetzt",
        "Whether it has a place in the picture": "Ob es einen Platz im Bild hat",
        "Ground": "Boden",
        "Where it lies on the environment's ground: x and y, metres": (
            "Wo es auf dem Boden der Umgebung liegt: x und y in Metern"
        ),
        "Residual": "Restfehler",
        "Pixels between the point and where the matched camera sees its ground": (
            "Pixel zwischen dem Punkt und der Stelle, an der die eingemessene Kamera ihn sieht"
        ),
        "Root mean square of the points' residuals, pixels": (
            "Quadratisches Mittel der Restfehler aller Punkte, in Pixeln"
        ),
        "Active Point": "Aktiver Punkt",
        "The point that the fields below show": "Der Punkt, den die Felder darunter zeigen",
        "Known Lens": "Brennweite bekannt",
        "Keep the field of view instead of finding it: needed where all points are close "
        "together or seen from straight above": (
            "Das Sichtfeld vorgeben, statt es zu berechnen: nötig, wenn alle Punkte nah "
            "beieinander liegen oder senkrecht von oben gesehen werden"
        ),
        "How much the camera sees from left to right": (
            "Wie viel die Kamera von links nach rechts sieht"
        ),
        "Clip": "Clip",
        "Movie clip with tracking markers": "Filmclip mit Tracking-Markern",
        "Tracks": "Spuren",
        "A track, a plane track, or how the names of several tracks begin": (
            "Eine Spur, eine Flächenspur oder der Anfang des Namens mehrerer Spuren"
        ),
        "Left, top, right, bottom in pixels; all zero: not in the picture": (
            "Links, oben, rechts, unten in Pixeln; alles null: nicht im Bild"
        ),
        "Numbers": "Zahlen",
        "Show the numbers of the box": "Die Zahlen des Rahmens zeigen",
        "Root": "Wurzel",
        "Empty that places the environment in the scene": (
            "Empty, das die Umgebung in der Szene platziert"
        ),
        "The encoded picture, as JSON": "Das kodierte Bild als JSON",
        "Encode a picture and put an Empty where each of its playable objects stands": (
            "Ein Bild kodieren und für jedes seiner spielbaren Objekte dort ein Empty anlegen, wo "
            "es steht"
        ),
        "Encode the picture as it is set up here; each playable object gets its Empty": (
            "Das Bild so kodieren, wie es hier eingerichtet ist; jedes spielbare Objekt bekommt "
            "sein Empty"
        ),
        "Make a camera where such pictures are usually taken from": (
            "Eine Kamera dort anlegen, wo solche Bilder gewöhnlich aufgenommen werden"
        ),
        "Matched Camera": "Eingemessene Kamera",
        "Make the camera that sees the placed ground points": (
            "Die Kamera anlegen, die die gesetzten Bodenpunkte sieht"
        ),
        "New Scene": "Neue Szene",
        "Leave this scene as it is and make the environment in a new one": (
            "Diese Szene lassen, wie sie ist, und die Umgebung in einer neuen anlegen"
        ),
        "Load the model and list its playable objects, so that their boxes can be drawn": (
            "Das Modell laden und seine spielbaren Objekte auflisten, um ihre Rahmen zeichnen zu "
            "können"
        ),
        "Find the playable objects in the picture and draw their boxes": (
            "Die spielbaren Objekte im Bild suchen und ihre Rahmen zeichnen"
        ),
        "The runtime has no detector installed; draw the boxes instead": (
            "In der Laufzeitumgebung ist kein Detektor installiert; die Rahmen von Hand zeichnen"
        ),
        "Take the boxes of the playable objects from the clip's tracking markers at this frame": (
            "Die Rahmen der spielbaren Objekte aus den Tracking-Markern des Clips zu diesem "
            "Einzelbild übernehmen"
        ),
        "Empty: every object that has tracks": "Leer: jedes Objekt, das Spuren hat",
        "Choose a movie clip with tracking markers": "Einen Filmclip mit Tracking-Markern wählen",
        "Name the tracks of one object or more": "Die Spuren mindestens eines Objekts nennen",
        "Drag a box around each playable object in the picture, down to its feet": (
            "Einen Rahmen um jedes spielbare Objekt im Bild ziehen, bis zu den Füßen"
        ),
        "Draw only this one's; empty: all": "Nur den von diesem zeichnen; leer: alle",
        "Left, top, right, bottom in pixels, where nobody draws": (
            "Links, oben, rechts, unten in Pixeln, wenn niemand zeichnet"
        ),
        "{name}: drag a box around it, down to its feet · Tab: next · X: not in the picture · "
        "Enter: done · Esc: cancel": (
            "{name}: einen Rahmen darum ziehen, bis zu den Füßen · Tab: weiter · X: nicht im Bild "
            "· Enter: fertig · Esc: abbrechen"
        ),
        "Click on the picture where it shows the points of the ground; drag them to correct them": (
            "Im Bild anklicken, wo die Punkte des Bodens zu sehen sind; zum Berichtigen ziehen"
        ),
        "Point {number}: click where the picture shows it, drag to correct · Tab: next · X: "
        "remove · Enter: done · Esc: cancel": (
            "Punkt {number}: anklicken, wo er im Bild zu sehen ist, zum Berichtigen ziehen · Tab: "
            "weiter · X: entfernen · Enter: fertig · Esc: abbrechen"
        ),
        "Index": "Index",
        "-1: a new point": "-1: ein neuer Punkt",
        "-1: the active point": "-1: der aktive Punkt",
        "Where the picture shows it": "Wo es im Bild zu sehen ist",
        "Where it lies on the ground, metres; as it is, if not given": (
            "Wo es auf dem Boden liegt, in Metern; ohne Angabe bleibt es dabei"
        ),
        "Add a point of the ground; place it on the picture with Place Points": (
            "Einen Punkt des Bodens hinzufügen; „Punkte setzen“ setzt ihn ins Bild"
        ),
        "Take a point of the ground away": "Einen Punkt des Bodens wegnehmen",
        "There are no points": "Es gibt keine Punkte",
        "Find the camera that sees the placed points of the ground where the picture shows them": (
            "Die Kamera berechnen, die die gesetzten Punkte des Bodens dort sieht, wo das Bild "
            "sie zeigt"
        ),
        "Place {count} or more points of the ground first; there are {placed}": (
            "Zuerst mindestens {count} Punkte des Bodens setzen; gesetzt: {placed}"
        ),
        "Give the active point the place of something that the model knows": (
            "Dem aktiven Punkt den Ort von etwas geben, das das Modell kennt"
        ),
        "Corners of the model's static objects": "Ecken der unbeweglichen Objekte des Modells",
        "Add a ground point first": "Zuerst einen Bodenpunkt hinzufügen",
        "Load the model first; it knows places of its own": (
            "Zuerst das Modell laden; es kennt eigene Orte"
        ),
        "Look at the picture through its camera, so that it can be framed in the 3D view": (
            "Das Bild durch seine Kamera ansehen, um es in der 3D-Ansicht einzurichten"
        ),
        "Render pictures of the framed picture's size, on square pixels": (
            "In der Größe des eingerichteten Bildes rendern, mit quadratischen Pixeln"
        ),
        "Choose a picture and press Show Picture first": (
            "Zuerst ein Bild wählen und „Bild zeigen“ drücken"
        ),
        "The scene's frame has its shape": "Die Szene hat schon sein Format",
        "matching the camera": "Kamera wird eingemessen",
    },
}
