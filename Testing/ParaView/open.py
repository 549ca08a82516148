#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Files are opened in ParaView's window as a user opens them, and what the view then draws came from the plugin's readers.

    python3 open.py PARAVIEW PLUGINS.xml FIELD.vtp FOLDER      needs an X server; writes into FOLDER

A field, then a sweep: File > Open, the file is selected in the dialog, the reader chosen among those that take such a
file, OK, Apply. PLUGINS.xml is the list of plugins that ParaView loads when it starts. The clicks are played by ParaView's
own testing of its widgets (--test-script); a script tells what is drawn.
"""
import os
import struct
import subprocess
import sys
import time

WATCH = """
from paraview.simple import *

view = GetActiveViewOrCreate("RenderView")


def seen(caller, event):
    for shown in view.Representations:
        if getattr(shown, "Input", None) and shown.Visibility:
            data = shown.Input.GetDataInformation()
            print("shown", shown.Input.SMProxy.GetXMLName(), data.GetNumberOfPoints(), shown.Representation, flush=True)


view.GetRenderWindow().AddObserver("EndEvent", seen)
"""
READERS = "pqClientMainWindow/pqSelectReaderDialog/"
SECONDS = 540  # 20 s on a quiet machine, minutes beside much other work
PLAYED = "is finished."  # what the client says when all was clicked
MISSED = "\ncritical:"  # what the client says when there is no such widget to click
WIDTH, HEIGHT, FRAMES = 24, 20, 9


def opening(path):
    """Events, each a widget, what it is told and with what."""
    return [
        ("pqClientMainWindow/menubar/menu_File", "activate", "actionFileOpen"),
        ("pqClientMainWindow/FileOpenDialog", "filesSelected", path),
        # In the list of readers the key B goes to the first that begins with it. The scroll bar hands the key on to the list,
        # which takes no such event itself. Type, key, modifiers, text, repetition, count.
        (READERS + "listWidget/qt_scrollarea_hcontainer/0QScrollBar0", "keyEvent", "6:66:0:B:0:1"),
        (READERS + "okButton", "activate", ""),
        ("pqClientMainWindow/propertiesDock/propertiesPanel/Accept", "activate", ""),
    ]


def write_events(path, events):
    lines = ['  <pqevent object="%s" command="%s" arguments="%s"/>' % event for event in events]
    with open(path, "w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" ?>\n<pqevents>\n%s\n</pqevents>\n' % "\n".join(lines))


def write_sweep(path):
    """A sweep of frames that move along z, as Plus writes one."""
    poses = []
    for k in range(FRAMES):
        pose = "0.4 0 0 0 0 0.4 0 0 0 0 1 %g 0 0 0 1" % (0.5 * k)
        poses.append("Seq_Frame%04d_ImageToReferenceTransform = %s\n" % (k, pose))
        poses.append("Seq_Frame%04d_ImageToReferenceTransformStatus = OK\nSeq_Frame%04d_Timestamp = %g\n" % (k, k, 0.1 * k))
    header = ("ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n"
              "DimSize = %d %d %d\nElementSpacing = 1 1 1\nUltrasoundImageOrientation = MF\nElementType = MET_UCHAR\n%s"
              "ElementDataFile = LOCAL\n" % (WIDTH, HEIGHT, FRAMES, "".join(poses)))
    pixels = [(7 * i + 5 * k) % 200 + 20 for k in range(FRAMES) for i in range(WIDTH * HEIGHT)]
    with open(path, "wb") as file:
        file.write(header.encode() + struct.pack("%dB" % len(pixels), *pixels))


def main(client, plugins, field, folder):
    if not os.environ.get("DISPLAY"):
        print("skipped: no X server (DISPLAY is not set)")
        return 0
    sweep, watch, events, log = (os.path.join(folder, name) for name in
                                 ("opened.igs.mha", "watch.py", "events.xml", "open.log"))
    write_sweep(sweep)
    write_events(events, opening(field) + opening(sweep))
    with open(watch, "w", encoding="utf-8") as file:
        file.write(WATCH)
    settings = os.path.join(folder, "ParaView")
    os.makedirs(settings, exist_ok=True)
    with open(os.path.join(settings, "ParaView5.11.0.ini"), "w", encoding="utf-8") as file:
        file.write("[General]\nGeneralSettings.ShowWelcomeDialog=false\n")  # it would take the clicks
    environment = dict(os.environ, HOME=folder, XDG_CONFIG_HOME=folder, PV_PLUGIN_CONFIG_FILE=plugins, PYTHONUNBUFFERED="1")
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen([client, "--script=" + watch, "--test-script=" + events, "--test-directory=" + folder],
                                   stdout=output, stderr=subprocess.STDOUT, env=environment)
    expected = ["shown BIGUSFieldReader 5000 'Point Gaussian'", "shown BIGUSSweepReader %d 'Outline'" % (WIDTH * HEIGHT * FRAMES)]
    said, end = "", time.time() + SECONDS
    try:
        while time.time() < end and process.poll() is None and MISSED not in said and not all(e in said for e in expected):
            time.sleep(0.5)
            with open(log, encoding="utf-8", errors="replace") as file:
                said = file.read()
            if PLAYED in said:
                end = min(end, time.time() + 30)  # what is drawn is drawn by then
    finally:
        process.kill()
        process.wait()
    print(said[-5000:])
    if not all(e in said for e in expected):
        print("failed: the client was to say", expected)
        return 1
    print("passed")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
