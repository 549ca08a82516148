#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A pvserver of two processes renders a field of which each has a part; a client sees the slice that one process renders.

    paraview_server.py PVSERVER PVPYTHON MPIEXEC PLUGIN FOLDER      starts the server, and itself in pvpython as the client

Prints a line that begins with "skipped:" where the server cannot be started.
"""
import os
import re
import subprocess
import sys
import threading

import numpy as np

PROCESSES = 2


def slice_of(path, **properties):
    from paraview import servermanager
    from paraview.simple import Delete
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = BIGUSFieldReader(FileName=path)  # noqa: F821  LoadPlugin defines it
    plane = BIGUSFieldSlice(Input=reader, Normal=[0.3, 0.5, 0.8], Size=[96, 80], **properties)  # noqa: F821
    plane.UpdatePipeline()
    image = servermanager.Fetch(plane)
    arrays = [image.GetPointData().GetArray(array) for array in ("Intensity", "vtkGhostType")]
    answer = (image.GetDimensions(), image.GetOrigin(), image.GetSpacing(),
              *(None if array is None else vtk_to_numpy(array).copy() for array in arrays))
    read = reader.GetDataInformation().GetNumberOfPoints()
    Delete(plane)
    Delete(reader)
    return answer, read


def client(port, plugin, folder):
    from paraview.simple import Connect, Delete, Disconnect, LoadPlugin, SaveData

    # On one process, the client's own: a field, and the slice that is wanted.
    LoadPlugin(plugin, remote=False, ns=globals())
    sweep = BIGUSPhantom(NumberOfFrames=17, FrameSize=[64, 48], PixelSize=0.5)  # noqa: F821
    trainer = BIGUSTrainer(Input=sweep, Automatic=0, Gaussians=6000, Iterations=40)  # noqa: F821
    trainer.UpdatePipeline()
    gaussians = trainer.GetDataInformation().GetNumberOfPoints()
    SaveData(folder + "/field.vtp", proxy=trainer)
    wanted, read = slice_of(folder + "/field.vtp")
    assert read == gaussians and wanted[3].std() > 0.01

    # The parts together are the field.
    parts = []
    for piece in range(3):
        part = BIGUSPartitionField(Input=trainer, NumberOfChunks=4, NumberOfPieces=3, Piece=piece)  # noqa: F821
        part.UpdatePipeline()
        parts.append(part.GetDataInformation().GetNumberOfPoints())
        Delete(part)
    assert min(parts) > 0 and sum(parts) == gaussians, parts
    # In the four pieces of a .pvtp.
    subprocess.run(["/usr/bin/python3", __file__, "split", folder], check=True)
    Delete(trainer)
    Delete(sweep)

    Connect("localhost", port)
    LoadPlugin(plugin, remote=True, ns=globals())
    for name in ("field.vtp", "field.pvtp"):
        (dimensions, origin, spacing, pixels, hidden), read = slice_of(f"{folder}/{name}")
        # Over both processes: more would mean that each read all of it.
        assert read == gaussians, (name, read, gaussians)
        assert dimensions == wanted[0] and np.allclose(origin, wanted[1]) and np.allclose(spacing, wanted[2]), name
        error = np.abs(pixels - wanted[3]).max()
        assert error <= 2e-4, (name, error)  # each side keeps to a tolerance of 1e-4
        # What counts as seen is a share of the whole field's mean coverage; pixels at the very border may differ.
        assert np.mean(hidden != wanted[4]) < 0.005 and 0.05 < np.mean(hidden != 0) < 0.95, name
        print(f"{name}: {read} Gaussians on {PROCESSES} processes, largest difference from one process {error:.1e}")
    # A part that one process cannot read is an error, and the server goes on.
    with open(folder + "/field_3.vtp", "w") as piece:
        piece.write("damaged")
    (_, _, _, pixels, _), _ = slice_of(folder + "/field.pvtp")
    assert pixels is None or not pixels.any(), "a slice was made of half a field"
    (_, _, _, pixels, _), _ = slice_of(folder + "/field.vtp")
    assert np.abs(pixels - wanted[3]).max() <= 2e-4
    print("a damaged piece was refused, and the next slice is whole")
    Disconnect()


def split(folder):
    """A .pvtp of four pieces as another program may write it: 256 Gaussians to each in turn, in VTK's own encoding."""
    from vtkmodules.vtkCommonCore import vtkIdList
    from vtkmodules.vtkCommonDataModel import vtkPolyData
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLPolyDataWriter

    reader = vtkXMLPolyDataReader()
    reader.SetFileName(folder + "/field.vtp")
    reader.Update()
    field = reader.GetOutput()
    sources = ""
    for piece in range(4):
        chosen, part, points = vtkIdList(), vtkPolyData(), vtkPoints()
        points.SetDataType(field.GetPoints().GetDataType())
        for i in range(field.GetNumberOfPoints()):
            if i // 256 % 4 == piece:
                chosen.InsertNextId(i)
                points.InsertNextPoint(field.GetPoint(i))
        part.SetPoints(points)
        part.SetFieldData(field.GetFieldData())
        part.GetPointData().CopyAllocate(field.GetPointData(), chosen.GetNumberOfIds())
        for k in range(chosen.GetNumberOfIds()):
            part.GetPointData().CopyData(field.GetPointData(), chosen.GetId(k), k)
        writer = vtkXMLPolyDataWriter()
        writer.SetInputData(part)
        writer.SetFileName(f"{folder}/field_{piece}.vtp")
        writer.Write()
        sources += f'<Piece Source="field_{piece}.vtp"/>'
    with open(folder + "/field.pvtp", "w") as index:
        index.write('<?xml version="1.0"?><VTKFile type="PPolyData" version="1.0" byte_order="LittleEndian"><PPolyData>'
                    f"{sources}</PPolyData></VTKFile>")


def main(pvserver, pvpython, mpiexec, plugin, folder):
    os.makedirs(folder, exist_ok=True)
    environment = dict(os.environ, OMPI_MCA_rmaps_base_oversubscribe="1", OMPI_ALLOW_RUN_AS_ROOT="1",
                       OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMPI_MCA_btl_vader_single_copy_mechanism="none",
                       # A process that waits for its client's next command asks without end: it is to give its core away
                       # meanwhile, and the one that works is not to be bound to a core that another test has.
                       OMPI_MCA_mpi_yield_when_idle="1", OMPI_MCA_hwloc_base_binding_policy="none")
    port = 20000 + os.getpid() % 20000
    server = subprocess.Popen([mpiexec, "-np", str(PROCESSES), pvserver, f"--server-port={port}"], env=environment,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    end = threading.Timer(300, server.kill)
    end.start()
    said = ""
    try:
        for line in server.stdout:
            said += line
            if re.search(r"Accepting connection", line):
                break
        else:
            print("skipped: pvserver ended before it listened:\n" + said[-2000:])
            return 0
        threading.Thread(target=server.stdout.read, daemon=True).start()  # so that it never waits for us
        done = subprocess.run([pvpython, __file__, "client", str(port), plugin, folder], timeout=240)
        return done.returncode
    finally:
        end.cancel()
        server.kill()
        server.wait()


if __name__ == "__main__":
    if sys.argv[1] == "client":
        client(int(sys.argv[2]), *sys.argv[3:])
        print("passed")
    elif sys.argv[1] == "split":
        split(sys.argv[2])
    else:
        sys.exit(main(*sys.argv[1:]))
