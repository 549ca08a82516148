#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field on several processes, each of which reads a part of it, and a slice that they render together.

    mpirun -np 4 /usr/bin/python3 slice_in_parts.py FIELD.vtp|FIELD.pvtp SLICE.mha

Needs mpi4py (Debian's python3-mpi4py). The slice has the same bits for any number of processes.
"""

import sys
import time

import bigus
from mpi4py import MPI  # It also starts MPI, which VTK leaves to the interpreter.
from vtkmodules.vtkIOImage import vtkMetaImageWriter
from vtkmodules.vtkParallelCore import vtkDummyController
from vtkmodules.vtkParallelMPI import vtkMPIController

if len(sys.argv) != 3:
    sys.exit(__doc__)
controller = vtkMPIController()
controller.Initialize()
if controller.GetNumberOfProcesses() == 1:
    controller = vtkDummyController()

reader = bigus.vtkBigusFieldReader()
reader.SetFileName(sys.argv[1])
part = bigus.vtkBigusPartitionField()
part.SetInputConnection(reader.GetOutputPort())
part.SetNumberOfPieces(controller.GetNumberOfProcesses())
part.SetPiece(controller.GetLocalProcessId())
part.Update()
is_empty = part.GetOutput().GetNumberOfPoints() == 0
here = [float("inf"), -float("inf")] * 3 if is_empty else part.GetOutput().GetBounds()
xmin, ymin, zmin = (MPI.COMM_WORLD.allreduce(here[k], MPI.MIN) for k in (0, 2, 4))
xmax, ymax, zmax = (MPI.COMM_WORLD.allreduce(here[k], MPI.MAX) for k in (1, 3, 5))
part.SetInputConnection(None)  # this process keeps its part alone
part_data = part.GetOutput()
del reader

reslice = bigus.vtkBigusReslice()
reslice.SetController(controller)
reslice.SetInputData(part_data)
reslice.SetOutputExtent(0, 511, 0, 511, 0, 0)
reslice.SetOutputSpacing((xmax - xmin) / 511, (ymax - ymin) / 511, 1)
reslice.SetOutputOrigin(xmin, ymin, 0)
times = []
for step in range(20):
    reslice.SetResliceAxesOrigin(0, 0, zmin + (zmax - zmin) * (0.5 + 0.01 * step))
    begun = time.monotonic()
    reslice.Update()
    times.append(1000 * (time.monotonic() - begun))

if controller.GetLocalProcessId() == 0:
    print(f"{controller.GetNumberOfProcesses()} processes, {part_data.GetNumberOfPoints()} Gaussians in the first: "
          f"{sorted(times)[len(times) // 2]:.1f} ms a slice, median of {len(times)}")
    writer = vtkMetaImageWriter()
    writer.SetInputConnection(reslice.GetOutputPort())
    writer.SetFileName(sys.argv[2])
    writer.SetCompression(False)
    writer.Write()
controller.Finalize()
