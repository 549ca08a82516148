#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field as files that hospitals read: volume.nii.gz, and a DICOM series of slices where pydicom is installed.

    volume_files.py FIELD FOLDER

The field's world is taken for RAS (right, anterior, superior), as 3D Slicer takes a tracked sweep.
"""
import os
import sys

import bigus
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkIOImage import vtkNIFTIImageWriter


def write_nifti(volume, path):
    axes = vtkMatrix4x4()  # NIfTI is in RAS, too; the writer adds the volume's origin
    writer = vtkNIFTIImageWriter()
    writer.SetInputData(volume)
    writer.SetQFac(1.0)
    writer.SetQFormMatrix(axes)
    writer.SetSFormMatrix(axes)
    writer.SetFileName(path)
    bigus.update(writer)


def write_dicom(volume, folder):
    import pydicom
    from pydicom.uid import ExplicitVRLittleEndian, UltrasoundImageStorage, generate_uid

    os.makedirs(folder, exist_ok=True)
    pixels = vtk_to_numpy(volume.GetPointData().GetScalars()).reshape(volume.GetDimensions()[::-1])
    study, series, frame = generate_uid(), generate_uid(), generate_uid()
    (x, y, z), (dx, dy, dz) = volume.GetOrigin(), volume.GetSpacing()
    for k, picture in enumerate(pixels):
        slice = pydicom.Dataset()
        slice.SOPClassUID, slice.SOPInstanceUID = UltrasoundImageStorage, generate_uid()
        slice.StudyInstanceUID, slice.SeriesInstanceUID, slice.FrameOfReferenceUID = study, series, frame
        slice.Modality, slice.PatientName, slice.PatientID, slice.SeriesDescription = "US", "", "", "BIGUS volume"
        slice.StudyDate = slice.StudyTime = slice.AccessionNumber = slice.ReferringPhysicianName = slice.StudyID = ""
        slice.PatientBirthDate = slice.PatientSex = slice.Manufacturer = ""
        slice.SeriesNumber, slice.InstanceNumber = 1, k + 1
        slice.ImagePositionPatient = [-x, -y, z + k * dz]  # DICOM is in LPS
        slice.ImageOrientationPatient, slice.PixelSpacing, slice.SliceThickness = [-1, 0, 0, 0, -1, 0], [dy, dx], dz
        slice.Rows, slice.Columns = picture.shape
        slice.SamplesPerPixel, slice.PhotometricInterpretation, slice.PixelRepresentation = 1, "MONOCHROME2", 0
        slice.BitsAllocated = slice.BitsStored = 8
        slice.HighBit, slice.PixelData = 7, np.ascontiguousarray(picture).tobytes() + b"\0" * (picture.size % 2)
        slice.file_meta = pydicom.dataset.FileMetaDataset()
        slice.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        pydicom.dcmwrite(os.path.join(folder, f"slice-{k:04d}.dcm"), slice, enforce_file_format=True)


def main(field, folder):
    os.makedirs(folder, exist_ok=True)
    voxelizer = bigus.vtkBigusVoxelizer()
    voxelizer.SetInputData(bigus.read_field(field))
    voxelizer.SetOutputSpacing(0.5, 0.5, 0.5)
    voxelizer.SetOutputScalarTypeToUnsignedChar()
    volume = bigus.update(voxelizer).GetOutput()
    write_nifti(volume, os.path.join(folder, "volume.nii.gz"))
    try:
        write_dicom(volume, os.path.join(folder, "dicom"))
    except ImportError:
        print("the DICOM series is left out: pydicom is not installed")


if __name__ == "__main__":
    main(*sys.argv[1:])
