"""Rendering and its strips, in German."""

MESSAGES = {
    "Operator": {
        "Open Frames Folder": "Ordner der Einzelbilder öffnen",
        "Overwrite Files?": "Dateien überschreiben?",
        "Render Again": "Neu rendern",
        "Render Range to Files": "Bereich in Dateien rendern",
        "Render the Environment Instead": "Stattdessen die Umgebung rendern",
        "Render to Sequencer": "In den Sequenzer rendern",
        "Select Environment": "Umgebung auswählen",
        "Use Exact Colours": "Farben exakt halten",
    },
    "*": {
        "Output": "Ausgabe",
        "Quality": "Qualität",
        "What rendering skips": "Was das Rendern auslässt",
        "Exact": "Exakt",
        "Nothing is approximated": "Nichts wird genähert",
        "Balanced": "Ausgewogen",
        "Faster, hardly visible differences": "Schneller, kaum sichtbare Unterschiede",
        "Draft": "Entwurf",
        "Fastest, for looking at movement": "Am schnellsten, um Bewegung zu beurteilen",
        "Passes": "Durchgänge",
        "Depth": "Tiefe",
        "Background": "Hintergrund",
        "Render a pass with the environment without its playable objects": (
            "Einen Durchgang mit der Umgebung ohne ihre spielbaren Objekte rendern"
        ),
        "Mask": "Maske",
        "Render a pass with the pixels that show the object": (
            "Einen Durchgang mit den Pixeln rendern, die das Objekt zeigen"
        ),
        "Layer": "Ebene",
        "Render a pass with the object alone, where nothing stands before it": (
            "Einen Durchgang mit dem Objekt allein rendern, wo nichts vor ihm steht"
        ),
        "Folder for the rendered frames": "Ordner für die gerenderten Einzelbilder",
        "Only Changes": "Nur Änderungen",
        "Render the frames that are missing or would look different now; off: render every "
        "frame again": (
            "Die Einzelbilder rendern, die fehlen oder jetzt anders aussähen; aus: alle neu rendern"
        ),
        "Render frames too that are there already and would look the same": (
            "Auch Einzelbilder rendern, die schon da sind und gleich aussähen"
        ),
        "Overwrite": "Überschreiben",
        "Replace files too that were not rendered here or were changed since": (
            "Auch Dateien ersetzen, die nicht hier gerendert oder seither geändert wurden"
        ),
        "Render what is missing or has changed, and show the range as one strip in a sequencer": (
            "Rendern, was fehlt oder sich geändert hat, und den Bereich als einen Streifen in "
            "einem Sequenzer zeigen"
        ),
        "Render what is missing or has changed to files, without a strip; for scripts and farms": (
            "Was fehlt oder sich geändert hat in Dateien rendern, ohne Streifen; für Skripte und "
            "Renderfarmen"
        ),
        "First frame; the scene's unless set": "Erstes Einzelbild; ohne Angabe das der Szene",
        "Last frame; the scene's unless set": "Letztes Einzelbild; ohne Angabe das der Szene",
        "Ask whether files may be lost, and render again if so": (
            "Fragen, ob Dateien verloren gehen dürfen, und wenn ja neu rendern"
        ),
        "Overwrite Files?": "Dateien überschreiben?",
        "Files in the frames folder that this job has not rendered, or that were changed since: "
        "{count}. Rendering would replace them.": (
            "Dateien im Ordner der Einzelbilder, die nicht hier gerendert oder seither geändert "
            "wurden: {count}. Das Rendern würde sie ersetzen."
        ),
        "Wait until Blender has rendered, or stop it with Esc": (
            "Warten, bis Blender gerendert hat, oder mit Esc abbrechen"
        ),
        "Switch the sequencer off for rendering, so that the scene's environment is rendered": (
            "Den Sequenzer beim Rendern ausschalten, sodass die Umgebung der Szene gerendert wird"
        ),
        "The environment is rendered already": "Die Umgebung wird schon gerendert",
        "Scene whose sequencer gets the strip; empty for one of its own, named after this scene "
        "with Edit behind it": (
            "Szene, deren Sequenzer den Streifen bekommt; leer: eine eigene, die wie diese heißt, "
            "mit Edit dahinter"
        ),
        "Edit Scene": "Schnitt-Szene",
        "Scene whose sequencer holds the rendered strip": (
            "Szene, deren Sequenzer den gerenderten Streifen enthält"
        ),
        "Channel": "Kanal",
        "Lowest channel for a new strip, which takes the first one from there on that is free "
        "at its time. A strip that is there already stays on its channel": (
            "Unterster Kanal für einen neuen Streifen, der von dort an den ersten nimmt, der zu "
            "seiner Zeit frei ist. Ein vorhandener Streifen bleibt auf seinem Kanal"
        ),
        "Start Offset": "Startversatz",
        "Frames by which the strip starts later than the pictures' own frame numbers": (
            "Einzelbilder, um die der Streifen später beginnt als die Nummern seiner Bilder"
        ),
        "Leave Sequencer Out": "Ohne Sequenzer",
        "Allow a strip in a scene that has an environment. Rendering that scene then shows the "
        "environment and never its sequencer, which is switched off in Post Processing": (
            "Einen Streifen in einer Szene mit Umgebung erlauben. Diese Szene zeigt beim Rendern "
            "dann die Umgebung und nie ihren Sequenzer, der unter Nachbearbeitung ausgeschaltet "
            "wird"
        ),
        "Frame {number} of {count}": "Einzelbild {number} von {count}",
        ", about {duration} left": ", noch etwa {duration}",
        "Esc to stop; finished frames are kept": "Esc bricht ab; Fertiges bleibt",
        "Reading the scene": "Szene wird gelesen",
        "Asking the worker": "Arbeitsprozess wird gefragt",
        "Comparing": "Vergleicht",
        "Shot": "Shot",
        "Version": "Version",
        "Rendered": "Gerendert",
        "Render the frames of this strip that have changed, from the scene that they came from": (
            "Die geänderten Einzelbilder dieses Streifens rendern, aus der Szene, aus der sie "
            "stammen"
        ),
        "Show the strip's pictures in the system's file browser": (
            "Die Bilder des Streifens im Dateimanager des Systems zeigen"
        ),
        "Go to the scene that the strip was rendered from and select its environment": (
            "Zur Szene gehen, aus der der Streifen gerendert wurde, und ihre Umgebung auswählen"
        ),
        "Select a strip that was rendered from a playable environment": (
            "Einen Streifen auswählen, der aus einer spielbaren Umgebung gerendert wurde"
        ),
        "The scene that the strip was rendered from is not in this file": (
            "Die Szene, aus der der Streifen gerendert wurde, ist nicht in dieser Datei"
        ),
        "Set the scene's colour management so that the model's colours are saved as they are": (
            "Das Farbmanagement der Szene so einstellen, dass die Farben des Modells gespeichert "
            "werden, wie sie sind"
        ),
        "The colours are saved as the model draws them already": (
            "Die Farben werden schon so gespeichert, wie das Modell sie zeichnet"
        ),
        "Colours differ from the model's": "Farben weichen vom Modell ab",
    },
}
