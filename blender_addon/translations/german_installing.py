"""The runtime and its worker, in German."""

MESSAGES = {
    "Operator": {
        "Check Again": "Erneut prüfen",
        "Remove the Runtime?": "Laufzeitumgebung entfernen?",
        "Set Up Runtime": "Laufzeitumgebung einrichten",
        "Show the Setting": "Einstellung zeigen",
        "Stop Setting Up": "Einrichten abbrechen",
        "Stop Worker": "Arbeitsprozess beenden",
    },
    "*": {
        "Runtime": "Laufzeitumgebung",
        "Set Up": "Einrichten",
        "Set Up the Runtime?": "Laufzeitumgebung einrichten?",
        "Remove the Runtime?": "Laufzeitumgebung entfernen?",
        "{folder} will be deleted": "{folder} wird gelöscht",
        "Runtime Python": "Python der Laufzeitumgebung",
        "A Python program that has playable-environments installed. Empty: the runtime that Set "
        "Up Runtime makes. The environment variable PLAYABLE_ENVIRONMENTS_PYTHON goes before "
        "both, so that a farm needs no preferences": (
            "Ein Python-Programm, in dem playable-environments installiert ist. Leer: die mit "
            "„Laufzeitumgebung einrichten“ angelegte. Die Umgebungsvariable "
            "PLAYABLE_ENVIRONMENTS_PYTHON hat vor beiden Vorrang, sodass eine Renderfarm keine "
            "Benutzereinstellungen braucht"
        ),
        "Arguments": "Argumente",
        "More arguments for the worker, such as --device cpu": (
            "Weitere Argumente für den Arbeitsprozess, zum Beispiel --device cpu"
        ),
        "Processor": "Prozessor",
        "What the runtime will compute on": "Womit die Laufzeitumgebung rechnen soll",
        "Runs on every computer; the smaller download": (
            "Läuft auf jedem Rechner; der kleinere Download"
        ),
        "Many times faster with an NVIDIA card; a far larger download": (
            "Mit einer NVIDIA-Karte um ein Vielfaches schneller; ein weit größerer Download"
        ),
        "Python": "Python",
        "The Python, 3.11 to 3.14, that the private one is made of. Empty: Blender's": (
            "Das Python, 3.11 bis 3.14, aus dem das eigene gemacht wird. Leer: das von Blender"
        ),
        "Build a private Python with the runtime in the add-on's folder; Remove takes it away "
        "again": (
            "Ein eigenes Python mit der Laufzeitumgebung im Ordner des Add-ons einrichten; "
            "„Entfernen“ nimmt es wieder weg"
        ),
        "Stop setting up the runtime; nothing of it stays, and an older one is untouched": (
            "Das Einrichten der Laufzeitumgebung abbrechen; davon bleibt nichts, und eine ältere "
            "bleibt unberührt"
        ),
        "Delete the runtime that Set Up Runtime made; a Python that you chose is left alone": (
            "Die mit „Laufzeitumgebung einrichten“ angelegte Laufzeitumgebung löschen; ein selbst "
            "gewähltes Python bleibt unberührt"
        ),
        "Start the runtime once and tell its version and what it computes on": (
            "Die Laufzeitumgebung einmal starten und zeigen, welche Version sie hat und womit sie "
            "rechnet"
        ),
        "End the worker process, which frees its memory; the next request starts another": (
            "Den Arbeitsprozess beenden, was seinen Speicher freigibt; die nächste Anfrage "
            "startet einen neuen"
        ),
        "Nothing is being set up": "Es wird gerade nichts eingerichtet",
        "Nothing was set up that could be removed": (
            "Es ist nichts eingerichtet, das entfernt werden könnte"
        ),
        "Something is under way already": "Es ist schon etwas im Gange",
        "No worker is running": "Es läuft kein Arbeitsprozess",
        "The runtime is being set up": "Die Laufzeitumgebung wird eingerichtet",
        "The runtime is set up": "Die Laufzeitumgebung ist eingerichtet",
        "Setting up was stopped; nothing of it is left": (
            "Das Einrichten wurde abgebrochen; es ist nichts davon übrig"
        ),
        "Drawing needs a runtime beside Blender. It is set up once": (
            "Zum Zeichnen braucht Blender eine Laufzeitumgebung. Sie wird einmal eingerichtet"
        ),
        "Setting up downloads files, and Blender's online access is off; turn on Allow Online "
        "Access in Preferences > System > Network": (
            "Das Einrichten lädt Dateien herunter, und der Online-Zugriff von Blender ist aus; in "
            "Benutzereinstellungen > System > Netzwerk den Online-Zugriff erlauben"
        ),
        "Setting up downloads files, and this Blender was started with --offline-mode; start it "
        "without, or choose a Python that has the runtime": (
            "Das Einrichten lädt Dateien herunter, und Blender wurde mit --offline-mode "
            "gestartet; ohne starten oder ein Python wählen, das die Laufzeitumgebung hat"
        ),
        "This copy of the add-on brings no runtime along: install the extension's zip, which "
        "`pe extension build` makes, or choose a Python that has playable-environments": (
            "Diese Kopie des Add-ons bringt keine Laufzeitumgebung mit: das Zip der Erweiterung "
            "installieren, das `pe extension build` baut, oder ein Python wählen, das "
            "playable-environments hat"
        ),
        "Not checked yet": "Noch nicht geprüft",
        "Checking the runtime": "Laufzeitumgebung wird geprüft",
        "Ready: version {version} on {device}": "Bereit: Version {version} auf {device}",
        "There is no runtime in this Python": "In diesem Python gibt es keine Laufzeitumgebung",
        "No runtime yet": "Noch keine Laufzeitumgebung",
        "The runtime cannot start": "Die Laufzeitumgebung lässt sich nicht starten",
        "Wrong version: the runtime is another build of {version} than this add-on": (
            "Falsche Version: die Laufzeitumgebung ist ein anderer Build von {version} als dieses "
            "Add-on"
        ),
        "Wrong version: the runtime is {version}, this add-on needs {needed}": (
            "Falsche Version: die Laufzeitumgebung ist {version}, dieses Add-on braucht {needed}"
        ),
        "Choose another Python, or empty the field and press Set Up Runtime": (
            "Ein anderes Python wählen, oder das Feld leeren und „Laufzeitumgebung einrichten“ "
            "drücken"
        ),
        "Press Set Up Runtime, or choose a Python that has playable-environments": (
            "„Laufzeitumgebung einrichten“ drücken oder ein Python wählen, das "
            "playable-environments hat"
        ),
        "Press Set Up Runtime to replace it, or install the right version there": (
            "Mit „Laufzeitumgebung einrichten“ ersetzen oder dort die richtige Version installieren"
        ),
        "Python: {python}": "Python: {python}",
        "Python: {python} (named by the environment variable {variable})": (
            "Python: {python} (aus der Umgebungsvariable {variable})"
        ),
        "Python: {python} (chosen in the preferences)": (
            "Python: {python} (in den Benutzereinstellungen gewählt)"
        ),
        "Python: {python} (set up by this add-on)": (
            "Python: {python} (von diesem Add-on eingerichtet)"
        ),
        "Python: {python} (Blender's own)": "Python: {python} (das von Blender)",
        "The worker failed": "Der Arbeitsprozess ist gescheitert",
        "Ready": "Bereit",
        "Ready on {device}": "Bereit auf {device}",
        "Starts when it is needed": "Startet bei Bedarf",
        "Folder: {folder}": "Ordner: {folder}",
        "Made of: {python}": "Gemacht aus: {python}",
        "Download: about {size} from {sources}": "Download: etwa {size} von {sources}",
        "Disk: about {size} while it is set up": "Festplatte: etwa {size} während des Einrichtens",
        "and": "und",
        "It takes some minutes, in which you can go on working": (
            "Es dauert einige Minuten; so lange geht die Arbeit weiter"
        ),
        "Blender itself and your other add-ons are not touched": (
            "Blender selbst und andere Add-ons bleiben unberührt"
        ),
        "GPU: for an NVIDIA card, a far larger download. CPU: runs everywhere": (
            "GPU: für eine NVIDIA-Karte, ein weit größerer Download. CPU: läuft überall"
        ),
        "Making an environment": "Umgebung wird angelegt",
        "Starting the runtime": "Laufzeitumgebung startet",
        "Putting it in place": "Wird an ihren Platz gebracht",
        "Looking for packages": "Pakete werden gesucht",
        "Loading the model": "Modell wird geladen",
        "Encoding the picture": "Bild wird kodiert",
        "Predicting the paths": "Pfade werden vorhergesagt",
    },
}
