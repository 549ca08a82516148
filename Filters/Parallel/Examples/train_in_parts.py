#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field that several processes train together, each a part of it.

    mpirun -np 2 /usr/bin/python3 -m mpi4py train_in_parts.py SWEEP FIELD.vtp [Option=value ...]

Needs mpi4py (Debian's python3-mpi4py); -m mpi4py ends all processes when one of them fails. Options are those of
vtkBigusTrainer: Gaussians=50000 HoldOut=8 TimeLimit=60. Every process reads the sweep; the first writes the field.
"""

import sys

import bigus
from mpi4py import MPI  # It also starts MPI, which VTK leaves to the interpreter.
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkParallelMPI import vtkMPIController

if len(sys.argv) < 3:
    sys.exit(__doc__)
controller = vtkMPIController()
controller.Initialize()
rank, processes = controller.GetLocalProcessId(), controller.GetNumberOfProcesses()

reader = bigus.vtkBigusSequenceReader()
reader.SetFileName(sys.argv[1])
trainer = bigus.vtkBigusTrainer()
trainer.SetController(controller)
trainer.SetInputConnection(reader.GetOutputPort())
for option in sys.argv[3:]:
    trainer.SetOption(*option.split("=", 1))
trainer.Update()
if trainer.GetErrorCode():
    sys.exit(1)

if rank == 0:
    log = trainer.GetLog()
    seconds, iterations = log.GetColumnByName("Seconds"), log.GetColumnByName("Iteration")
    last = log.GetNumberOfRows() - 1
    steps = iterations.GetValue(last) - iterations.GetValue(0)
    step = (seconds.GetValue(last) - seconds.GetValue(0)) / steps if steps else 0.0
    done = trainer.GetIterationsDone()
    print(f"{trainer.GetDevice()}: {trainer.GetOutput().GetNumberOfPoints()} Gaussians, {done} iterations of "
          f"{1000 * step:.1f} ms in {trainer.GetSeconds():.1f} s. The first process sent "
          f"{trainer.GetSentBytes() / done / 1e6:.3f} MB an iteration, waited {trainer.GetWaitingSeconds():.2f} s "
          f"and exchanged for {trainer.GetSendingSeconds():.2f} s.")
    writer = bigus.vtkBigusFieldWriter()
    writer.SetInputConnection(trainer.GetOutputPort())
    writer.SetFileName(sys.argv[2])
    writer.Write()
    held_out = vtk_to_numpy(trainer.GetHeldOutFrames())
    if len(held_out):
        frames = bigus.frames(reader.GetOutput())
        poses = vtk_to_numpy(trainer.GetCorrectedPoses()).reshape(-1, 4, 4)
        scores = [bigus.metrics(bigus.reslice(trainer.GetOutput(), poses[k], size=frames.shape[:0:-1]), frames[k])["psnr"]
                  for k in held_out]
        print(f"{sum(scores) / len(scores):.3f} dB on {len(scores)} frames that were held out")
controller.Finalize()
