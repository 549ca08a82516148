// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Outputs.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <iterator>
#include <limits>
#include <ostream>

#include "Console.h"
#include "Exit.h"
#include "Files.h"
#include "IO/SequenceTimes.h"
#include "Inputs.h"
#include "Pipeline.h"
#include "vtkBigusSequenceWriter.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkImageFlip.h"
#include "vtkMatrix3x3.h"
#include "vtkNew.h"
#include "vtkPNGWriter.h"
#include "vtkPointData.h"
#include "vtkUnsignedCharArray.h"
#include "vtkXMLImageDataWriter.h"

namespace bigus::command
{

namespace
{

/// Raw little-endian pixels, as they lie in memory.
void WritePixels(std::ostream& file, vtkImageData* image)
{
  vtkDataArray* scalars = image->GetPointData()->GetScalars();
  file.write(static_cast<const char*>(scalars->GetVoidPointer(0)),
             static_cast<std::streamsize>(scalars->GetNumberOfValues()) * scalars->GetDataTypeSize());
}

/// "uint8" or "MET_UCHAR" and their like.
const char* PixelTypeName(vtkImageData* image, bool nrrd)
{
  switch (image->GetScalarType())
  {
    case VTK_UNSIGNED_CHAR:
      return nrrd ? "uint8" : "MET_UCHAR";
    case VTK_UNSIGNED_SHORT:
      return nrrd ? "uint16" : "MET_USHORT";
    case VTK_FLOAT:
      return nrrd ? "float" : "MET_FLOAT";
    default:
      throw OutputError(std::string("Pixels of type ") + image->GetScalarTypeAsString() + " cannot be written.");
  }
}

/// Axis `k` of a volume in space, a unit vector.
std::array<double, 3> Axis(vtkImageData* volume, int k)
{
  const double* direction = volume->GetDirectionMatrix()->GetData();
  return {direction[k], direction[3 + k], direction[6 + k]};
}

std::array<double, 3> FirstVoxel(vtkImageData* volume)
{
  std::array<double, 3> place;
  int extent[6];
  volume->GetExtent(extent);
  volume->TransformIndexToPhysicalPoint(extent[0], extent[2], extent[4], place.data());
  return place;
}

/// Volumes are written in LPS, which 3D Slicer writes in NRRD and all readers of MetaImage assume.
std::array<double, 3> ToLps(const std::array<double, 3>& v, WorldSystem world)
{
  // Not -x, because that of 0 is written as -0.
  return world == WorldSystem::Ras ? std::array<double, 3>{0 - v[0], 0 - v[1], v[2]} : v;
}

void BeginNrrd(std::ostream& file, vtkImageData* image, bool oneSliceEach = false)
{
  int size[3];
  image->GetDimensions(size);
  file.precision(17);
  file << "NRRD0005\n"
       << "type: " << PixelTypeName(image, true) << "\ndimension: " << (oneSliceEach ? 4 : 3) << "\nsizes: " << size[0]
       << ' ' << size[1] << (oneSliceEach ? " 1 " : " ") << size[2] << "\nencoding: raw\nendian: little\n";
}

/// What 3D Slicer browses two sequences by together: the list axis is time in s, with the decimals that it writes itself.
std::vector<double> ToVector(vtkDataArray* times)
{
  std::vector<double> seconds;
  for (vtkIdType k = 0; k < times->GetNumberOfTuples(); ++k)
  {
    seconds.push_back(times->GetTuple1(k));
  }
  return seconds;
}

std::string SlicersTimes(vtkDataArray* times)
{
  std::string text =
      "labels: \"\" \"\" \"\" \"time\"\nunits: \"\" \"\" \"\" \"s\"\naxis 3 index type:=numeric\naxis 3 index values:=";
  for (vtkIdType k = 0; k < times->GetNumberOfTuples(); ++k)
  {
    text += (k ? " " : "") + FormatNumber(times->GetTuple1(k), 3);
  }
  return text + "\n";
}

void WriteNrrdSequence(vtkImageData* stack, const std::string& path)
{
  // 3D Slicer takes what ends so for a sequence of volumes of one slice. Its pixels lie at (i, j, 0) in RAS, so that the
  // transform ImageToReference above them puts them where they belong.
  const bool forSlicer = HasSuffix(path, ".seq.nrrd");
  const char* const axes = forSlicer
                               ? "space: left-posterior-superior\nspace directions: (-1,0,0) (0,-1,0) (0,0,1) none\n"
                                 "space origin: (0,0,0)\nkinds: domain domain domain list\n"
                               : "kinds: domain domain list\n";
  WriteAtomically(path,
                  [stack, forSlicer, axes](std::ostream& file)
                  {
                    BeginNrrd(file, stack, forSlicer);
                    vtkFieldData* data = stack->GetFieldData();
                    vtkDataArray* poses = data->GetArray("ImageToReference");
                    vtkDataArray* times = data->GetArray("Timestamp");
                    file << axes << (forSlicer && times ? SlicersTimes(times) : "")
                         << "ultrasound image orientation:=MF\n"  // IGSIO's names
                         << "ultrasound image type:=BRIGHTNESS\n";
                    if (times && !StatedUnitOf(ToVector(times)).empty())
                    {
                      file << "TimestampUnit:=s\n";
                    }
                    for (vtkIdType k = 0; k < poses->GetNumberOfTuples(); ++k)
                    {
                      char frame[32];
                      std::snprintf(frame, sizeof frame, "Seq_Frame%04lld_", static_cast<long long>(k));
                      file << frame << "ImageToReferenceTransform:=";
                      for (int c = 0; c < 16; ++c)
                      {
                        file << (c ? " " : "") << poses->GetComponent(k, c);
                      }
                      file << '\n' << frame << "ImageToReferenceTransformStatus:=OK\n" << frame << "Status:=OK\n";
                      if (times)
                      {
                        file << frame << "Timestamp:=" << times->GetTuple1(k) << '\n';
                      }
                    }
                    file << '\n';
                    WritePixels(file, stack);
                  });
}

void WriteNrrdVolume(vtkImageData* volume, const std::string& path, WorldSystem world)
{
  WriteAtomically(path,
                  [volume, world](std::ostream& file)
                  {
                    BeginNrrd(file, volume);
                    file << "kinds: domain domain domain\nspace: left-posterior-superior\nspace directions:";
                    for (int k = 0; k < 3; ++k)
                    {
                      const std::array<double, 3> axis = ToLps(Axis(volume, k), world);
                      const double side = volume->GetSpacing()[k];
                      file << " (" << axis[0] * side << ',' << axis[1] * side << ',' << axis[2] * side << ')';
                    }
                    const std::array<double, 3> first = ToLps(FirstVoxel(volume), world);
                    file << "\nspace origin: (" << first[0] << ',' << first[1] << ',' << first[2] << ")\n\n";
                    WritePixels(file, volume);
                  });
}

void WriteMetaVolume(vtkImageData* volume, const std::string& path, WorldSystem world)
{
  WriteAtomically(path,
                  [volume, world](std::ostream& file)
                  {
                    int size[3];
                    volume->GetDimensions(size);
                    const double* spacing = volume->GetSpacing();
                    const std::array<double, 3> first = ToLps(FirstVoxel(volume), world);
                    file.precision(17);
                    file << "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
                         << "CompressedData = False\nTransformMatrix =";
                    for (int k = 0; k < 3; ++k)
                    {
                      const std::array<double, 3> axis = ToLps(Axis(volume, k), world);
                      file << ' ' << axis[0] << ' ' << axis[1] << ' ' << axis[2];
                    }
                    file << "\nOffset = " << first[0] << ' ' << first[1] << ' ' << first[2]
                         << "\nCenterOfRotation = 0 0 0\nElementSpacing = " << spacing[0] << ' ' << spacing[1] << ' '
                         << spacing[2] << "\nDimSize = " << size[0] << ' ' << size[1] << ' ' << size[2]
                         << "\nElementType = " << PixelTypeName(volume, false) << "\nElementDataFile = LOCAL\n";
                    WritePixels(file, volume);
                  });
}

/// Rows of pixels from the top down, `channels` bytes each.
void WritePng(const unsigned char* pixels, int width, int height, int channels, std::ostream& file)
{
  vtkNew<vtkImageData> image;
  image->SetExtent(0, width - 1, 0, height - 1, 0, 0);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, channels);
  std::copy_n(pixels, image->GetNumberOfPoints() * channels, static_cast<unsigned char*>(image->GetScalarPointer()));

  vtkNew<vtkImageFlip> flip;  // VTK writes its last row first, and our first row belongs on top
  flip->SetInputData(image);
  flip->SetFilteredAxis(1);
  vtkNew<vtkPNGWriter> writer;
  writer->SetInputConnection(flip->GetOutputPort());
  writer->WriteToMemoryOn();
  writer->Write();
  vtkUnsignedCharArray* png = writer->GetResult();
  file.write(reinterpret_cast<const char*>(png->GetPointer(0)), png->GetNumberOfValues());
}

void WritePng(vtkImageData* stack, int slice, std::ostream& file)
{
  int size[3];
  stack->GetDimensions(size);
  const auto* bytes = static_cast<const unsigned char*>(stack->GetScalarPointer());
  WritePng(bytes + slice * static_cast<vtkIdType>(size[0]) * size[1], size[0], size[1], 1, file);
}

}  // namespace

vtkSmartPointer<vtkImageData> NewStack(const std::vector<SlicePlane>& planes, const std::vector<double>& timestamps,
                                       bool bytes)
{
  auto stack = vtkSmartPointer<vtkImageData>::New();
  const int count = static_cast<int>(planes.size());
  stack->SetExtent(0, planes.front().width - 1, 0, planes.front().height - 1, 0, count - 1);
  stack->AllocateScalars(bytes ? VTK_UNSIGNED_CHAR : VTK_FLOAT, 1);

  const auto newArray = [&stack, count](const char* name, int components)
  {
    auto array = vtkSmartPointer<vtkDoubleArray>::New();
    array->SetName(name);
    array->SetNumberOfComponents(components);
    array->SetNumberOfTuples(count);
    stack->GetFieldData()->AddArray(array);
    return array;
  };
  const auto poses = newArray("ImageToReference", 16);
  for (int k = 0; k < count; ++k)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> pose = planes[k].ImageToReference();
    poses->SetTypedTuple(k, pose.data());
  }
  if (!timestamps.empty())
  {
    const auto times = newArray("Timestamp", 1);
    std::copy(timestamps.begin(), timestamps.end(), times->GetPointer(0));
  }
  return stack;
}

void SetImage(vtkImageData* stack, int k, vtkImageData* image)
{
  vtkDataArray* pixels = image->GetPointData()->GetScalars();
  stack->GetPointData()->GetScalars()->InsertTuples(k * pixels->GetNumberOfTuples(), pixels->GetNumberOfTuples(), 0,
                                                    pixels);
}

void RequireStackName(const std::string& path)
{
  RequireOutput(HasSuffix(path, ".mha") || HasSuffix(path, ".nrrd") || HasSuffix(path, ".png"), "Cannot write '", path,
                "': the name must end in .mha (.igs.mha), .nrrd or .png.");
}

std::vector<std::string> WriteStack(vtkImageData* stack, const std::string& path, const std::vector<int>& numbers,
                                    Console& console)
{
  if (HasSuffix(path, ".png"))
  {
    const int count = stack->GetDimensions()[2];
    const int last = *std::max_element(numbers.begin(), numbers.end());
    std::vector<std::string> names;
    for (int k = 0; k < count; ++k)
    {
      names.push_back(count == 1 ? path : NumberedPath(path, numbers[k], last + 1));
    }
    WriteTogether(names,
                  [&](std::size_t k, std::ostream& file)
                  {
                    if (IsInterrupted())
                    {
                      throw Interrupted();
                    }
                    WritePng(stack, static_cast<int>(k), file);
                    console.Progress("Writing", (static_cast<double>(k) + 1) / count);
                  });
    console.EndProgress();
    return names;
  }
  if (HasSuffix(path, ".nrrd"))
  {
    WriteNrrdSequence(stack, path);
    return {path};
  }
  vtkNew<vtkBigusSequenceWriter> writer;
  writer->SetInputData(stack);
  writer->SetFileName(path.c_str());
  Write(writer, console, "Writing");
  return {path};
}

void RequirePosesName(const std::string& path)
{
  RequireOutput(HasSuffix(path, ".mha") || HasSuffix(path, ".nrrd") || HasSuffix(path, ".csv"), "Cannot write '", path,
                "': the name must end in .mha (.igs.mha), .nrrd or .csv.");
}

void WritePosesCsv(vtkDataArray* poses, int width, int height, const std::string& path,
                   const std::vector<CsvColumn>& columns)
{
  WriteAtomically(path,
                  [&](std::ostream& file)
                  {
                    // As the stream would with so many digits, in a third of the time.
                    const auto put = [&file](double number)
                    {
                      char text[32];
                      const char* const end = std::to_chars(text, std::end(text), number, std::chars_format::general,
                                                            std::numeric_limits<double>::max_digits10)
                                                  .ptr;
                      file.put(',').write(text, end - text);
                    };
                    file << "width,height";
                    for (int n = 0; n < 16; ++n)
                    {
                      file << ",m" << n / 4 << n % 4;
                    }
                    for (const CsvColumn& column : columns)
                    {
                      file << ',' << column.first;
                    }
                    file << '\n';
                    for (vtkIdType k = 0; k < poses->GetNumberOfTuples(); ++k)
                    {
                      file << width << ',' << height;
                      for (int n = 0; n < 16; ++n)
                      {
                        put(poses->GetComponent(k, n));
                      }
                      for (const CsvColumn& column : columns)
                      {
                        put(column.second[k]);
                      }
                      file << '\n';
                    }
                  });
}

void WritePoses(vtkImageData* stack, const std::string& path, const std::vector<CsvColumn>& columns, Console& console)
{
  if (!HasSuffix(path, ".csv"))
  {
    WriteStack(stack, path, {}, console);
    return;
  }
  std::vector<CsvColumn> all;
  if (vtkDataArray* times = stack->GetFieldData()->GetArray("Timestamp"))
  {
    const std::vector<double> seconds = ToVector(times);
    all.emplace_back(StatedUnitOf(seconds).empty() ? "timestamp" : "timestamp_sec", seconds);
  }
  all.insert(all.end(), columns.begin(), columns.end());
  const int* size = stack->GetDimensions();
  WritePosesCsv(stack->GetFieldData()->GetArray("ImageToReference"), size[0], size[1], path, all);
}

std::string NameOf(const std::vector<std::string>& files)
{
  return files.size() == 1 ? files.front() : files.front() + " ... " + files.back();
}

void RequireVolumeName(const std::string& path)
{
  RequireOutput(HasSuffix(path, ".mha") || HasSuffix(path, ".nrrd") || HasSuffix(path, ".vti"), "Cannot write '", path,
                "': the name of a volume must end in .mha, .nrrd or .vti.");
}

void WritePage(const Page& page, const std::string& path)
{
  WriteAtomically(path, [&page](std::ostream& file) { WritePng(page.rgb.data(), page.width, page.height, 3, file); });
}

void WriteVolume(vtkImageData* volume, const std::string& path, WorldSystem world, Console& console)
{
  if (HasSuffix(path, ".nrrd"))
  {
    WriteNrrdVolume(volume, path, world);
  }
  else if (HasSuffix(path, ".mha"))
  {
    WriteMetaVolume(volume, path, world);
  }
  else
  {
    vtkNew<vtkXMLImageDataWriter> writer;
    writer->SetInputData(volume);
    writer->WriteToOutputStringOn();
    Write(writer, console, "Writing");
    const std::string text = writer->GetOutputString();
    WriteAtomically(path, [&text](std::ostream& file) { file << text; });
  }
}

}  // namespace bigus::command
