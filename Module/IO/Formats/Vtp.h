// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields in VTK's XML format for PolyData,
// https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#pragma once

#include <string>

class vtkPolyData;

namespace bigus
{

/// The points and arrays that the file holds, not yet checked to be a field. The encoding that vtkBigusFieldWriter
/// writes (raw appended data, zlib, sizes in 64 bits, floats and doubles in this machine's order) is read by our own
/// code, which withstands any damage. Other encodings go to vtkXMLPolyDataReader. Throws FileError.
void ReadVtp(const std::string& fileName, vtkPolyData* field);

/// Whether our own code reads the file. Throws FileError.
bool IsOwnVtp(const std::string& fileName);

/// Writes a field without other arrays, as ShareField makes it. An array whose values are all floats is written in 32
/// bits. The file is made by name, for AtomicFile. False when that failed.
bool WriteVtp(vtkPolyData* field, const std::string& fileName);

}  // namespace bigus
