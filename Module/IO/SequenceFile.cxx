// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/SequenceFile.h"

#include <algorithm>
#include <initializer_list>
#include <string_view>

#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/Formats/SequenceHeaders.h"
#include "IO/SequenceTimes.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

bool LooksLikePng(const std::string& beginning)
{
  return beginning.rfind("\x89PNG", 0) == 0;
}

void ReadPlainPng(SequenceFile& file)
{
  const PngHeader header = ReadPngHeader(file.fileName);
  file.format = "PNG image";
  file.orientation = "MF";
  file.encoding = Encoding::Png;
  file.width = header.width;
  file.height = header.height;
  file.elementType = header.elementType;
  file.channels = header.channels;
  file.numberOfFrames = 1;
  file.images = {file.fileName};
  file.frames.resize(1);
}

/// What to do with a file of another kind, by the ending of its name; nothing where the ending says nothing.
std::string HowToBring(const std::string& fileName)
{
  const std::string name = Lowercase(fileName);
  const auto endsWith = [&name](std::initializer_list<std::string_view> endings)
  {
    return std::any_of(endings.begin(), endings.end(),
                       [&name](std::string_view ending) {
                         return name.size() >= ending.size() &&
                                name.compare(name.size() - ending.size(), ending.size(), ending) == 0;
                       });
  };
  const std::string convert = "'python3 -m bigus.convert " + Shortened(fileName) + " POSES -o sweep.igs.mha'";
  if (endsWith({".mp4", ".mkv", ".avi", ".mov", ".webm"}))
  {
    return ". A video has no poses: with a table of them " + convert + " makes a sequence";
  }
  if (endsWith({".dcm", ".dicom", ".h5", ".hdf5", ".npy", ".npz"}))
  {
    return ". " + convert + " makes a sequence of images and poses";
  }
  if (endsWith({".mrb", ".mrml"}))
  {
    return ". A scene of 3D Slicer holds many things: save the sequence of images alone, as .seq.nrrd";
  }
  if (endsWith({".tfm"}))
  {
    return ". A transform alone has no images; it places a plane ('bigus slice --poses') or a field ('bigus convert "
           "--transform')";
  }
  if (endsWith({".csv", ".txt", ".tsv"}))
  {
    return " in its first line, separated by commas. Poses as positions and quaternions, and of other column names, are "
           "read by 'python3 -m bigus.convert IMAGES " +
           Shortened(fileName) + " -o sweep.igs.mha'";
  }
  if (endsWith({".nii", ".nii.gz"}))
  {
    return ". Read it in Python, with nibabel, and hand pixels and poses over: bigus.write(bigus.sweep(frames, poses), "
           "\"sweep.igs.mha\")";
  }
  if (endsWith({".jpg", ".jpeg", ".bmp", ".tif", ".tiff"}))
  {
    return ". Images are read as PNG, with a CSV of poses; others by 'python3 -m bigus.convert FOLDER POSES -o "
           "sweep.igs.mha'";
  }
  return {};
}

}  // namespace

std::size_t BytesPerElement(ElementType type)
{
  return type == ElementType::UInt8 ? 1 : type == ElementType::UInt16 ? 2 : 4;
}

const char* NameOf(ElementType type)
{
  return type == ElementType::UInt8 ? "unsigned char" : type == ElementType::UInt16 ? "unsigned short" : "float";
}

std::string SequenceFile::PixelType() const
{
  return std::string(isSigned ? "short" : NameOf(elementType)) +
         (channels > 1 ? ", " + std::to_string(channels) + " channels" : "");
}

const char* NameOf(Encoding encoding)
{
  switch (encoding)
  {
    case Encoding::Raw:
      return "raw";
    case Encoding::Zlib:
      return "zlib";
    case Encoding::Gzip:
      return "gzip";
    default:
      return "png";
  }
}

bool IsSequence(const std::string& fileName, bool plain)
{
  const std::string beginning(WithoutMark(FileBeginning(fileName, 4096)));
  if (LooksLikePoseCsv(beginning) || (plain && LooksLikePng(beginning)))
  {
    return true;
  }
  if (plain)
  {
    return LooksLikeMetaImage(beginning) || LooksLikeNrrd(beginning);
  }
  // "Seq_Frame0000_ProbeToTrackerTransform = ..." and not "TransformMatrix = ..."; fields of NRRD have ":=".
  if (LooksLikeNrrd(beginning))
  {
    return HasBefore(fileName, "Transform:=", "\n\n") || HasBefore(fileName, "Transform :=", "\n\n");
  }
  return LooksLikeMetaImage(beginning) && (HasBefore(fileName, "Transform =", "ElementDataFile") ||
                                           HasBefore(fileName, "Transform=", "ElementDataFile"));
}

SequenceFile ReadSequenceFile(const std::string& fileName, const ImageOptions& images)
{
  InputFile input(fileName);
  Require(FileFault::Truncated, input.Size() != 0, fileName, ": the file is empty");
  SequenceFile file;
  file.fileName = fileName;
  const std::string beginning(WithoutMark(FileBeginning(fileName, 4096)));
  if (LooksLikeNrrd(beginning))
  {
    ReadNrrdHeader(file, input, images);
  }
  else if (LooksLikeMetaImage(beginning))
  {
    ReadMetaImageHeader(file, input);
  }
  else if (LooksLikePoseCsv(beginning))
  {
    ReadPoseCsv(file, input, images);
  }
  else if (images.plain && LooksLikePng(beginning))
  {
    ReadPlainPng(file);
  }
  else
  {
    throw FileError(FileFault::Unrecognized,
                    fileName +
                        (images.plain ? ": neither a MetaImage (.mha, .mhd), an NRRD, a PNG image, nor a CSV of "
                                      : ": neither a MetaImage sequence (.igs.mha, .mha, .mhd), an NRRD sequence, "
                                        "nor a CSV of ") +
                        "poses with columns m00 to m33" + HowToBring(fileName));
  }
  TakeTimesInSeconds(file);
  return file;
}

}  // namespace bigus
