# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# What README.md takes for given in its Python (Testing/Documentation/test_rooms.py).
reader = bigus.vtkBigusSequenceReader()
reader.SetFileName("sweep.igs.mha")
reader.Update()
arriving, plane, slice = [], vtkMatrix4x4(), vtkImageData()
for second in range(12):
    frame, matrix = vtkImageData(), vtkMatrix4x4()
    frame.SetDimensions(32, 24, 1)
    frame.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
    frame.GetPointData().GetScalars().Fill(90)
    matrix.SetElement(2, 3, second)
    arriving.append((frame, matrix, second))
