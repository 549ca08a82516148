// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSequenceWriter.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "Data/Arrays.h"
#include "Data/Progress.h"
#include "IO/AtomicFile.h"
#include "IO/Bytes.h"
#include "IO/FileError.h"
#include "IO/Text.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtk_zlib.h"

vtkStandardNewMacro(vtkBigusSequenceWriter);

namespace
{

bigus::FileError InputError(const std::string& message)
{
  return bigus::FileError(vtkErrorCode::UserError, message);
}

std::string ElementTypeName(int vtkType)
{
  switch (vtkType)
  {
    case VTK_UNSIGNED_CHAR:
      return "MET_UCHAR";
    case VTK_UNSIGNED_SHORT:
      return "MET_USHORT";
    case VTK_FLOAT:
      return "MET_FLOAT";
    default:
      throw InputError("pixels of type " + std::string(vtkImageScalarTypeNameMacro(vtkType)) +
                       "; unsigned char, unsigned short and float are written");
  }
}

void CheckFrameName(const char* name)
{
  const std::string text = name ? name : "";
  const bool plain =
      !text.empty() &&
      std::all_of(text.begin(), text.end(),
                  [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); });
  if (!plain || text[0] < 'A' || text[0] > 'Z')
  {
    throw InputError("coordinate frame name " + bigus::Quoted(text) +
                     "; letters and digits, with a capital first, are expected");
  }
}

// Compresses what it is given into a file.
class Deflater
{
public:
  explicit Deflater(bigus::AtomicFile& file) : file_(file)
  {
    if (deflateInit(&zlib_, Z_DEFAULT_COMPRESSION) != Z_OK)
    {
      throw bigus::FileError(vtkErrorCode::UnknownError, "zlib cannot be started");
    }
  }
  ~Deflater() { deflateEnd(&zlib_); }
  Deflater(const Deflater&) = delete;
  Deflater& operator=(const Deflater&) = delete;

  void Write(const unsigned char* bytes, std::size_t count)
  {
    while (count > 0)
    {
      const std::size_t part = std::min<std::size_t>(count, 1u << 30);
      zlib_.next_in = const_cast<unsigned char*>(bytes);
      zlib_.avail_in = static_cast<uInt>(part);
      Run(Z_NO_FLUSH);
      bytes += part;
      count -= part;
    }
  }

  void Finish() { Run(Z_FINISH); }

private:
  void Run(int flush)
  {
    do
    {
      zlib_.next_out = buffer_.data();
      zlib_.avail_out = static_cast<uInt>(buffer_.size());
      deflate(&zlib_, flush);
      file_.Write(buffer_.data(), buffer_.size() - zlib_.avail_out);
    } while (zlib_.avail_out == 0);
  }

  bigus::AtomicFile& file_;
  z_stream zlib_ = {};
  std::vector<unsigned char> buffer_ = std::vector<unsigned char>(256 * 1024);
};

}  // namespace

vtkBigusSequenceWriter::vtkBigusSequenceWriter()
    : FileName(nullptr), FromFrame(nullptr), ToFrame(nullptr), Compression(1)
{
  this->SetFromFrame("Image");
  this->SetToFrame("Reference");
}

vtkBigusSequenceWriter::~vtkBigusSequenceWriter()
{
  this->SetFileName(nullptr);
  this->SetFromFrame(nullptr);
  this->SetToFrame(nullptr);
}

int vtkBigusSequenceWriter::FillInputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkAlgorithm::INPUT_REQUIRED_DATA_TYPE(), "vtkImageData");
  return 1;
}

vtkImageData* vtkBigusSequenceWriter::GetInput()
{
  return vtkImageData::SafeDownCast(this->GetInputDataObject(0, 0));
}

#if VTK_VERSION_NUMBER >= VTK_VERSION_CHECK(9, 7, 0)
bool vtkBigusSequenceWriter::WriteDataAndReturn()
{
  this->WriteFile();
  return this->GetErrorCode() == vtkErrorCode::NoError;
}
#else
void vtkBigusSequenceWriter::WriteData()
{
  this->WriteFile();
}
#endif

void vtkBigusSequenceWriter::WriteFile()
{
  try
  {
    if (!this->FileName || !*this->FileName)
    {
      throw bigus::FileError(vtkErrorCode::NoFileNameError, "FileName is not set");
    }
    const std::string fileName = this->FileName;
    if (fileName.size() < 4 || bigus::Lowercase(fileName.substr(fileName.size() - 4)) != ".mha")
    {
      throw bigus::FileError(vtkErrorCode::UnrecognizedFileTypeError,
                             fileName + ": sequences are written as .mha (or .igs.mha) only");
    }
    CheckFrameName(this->FromFrame);
    CheckFrameName(this->ToFrame);
    vtkImageData* const image = this->GetInput();
    vtkDataArray* const scalars = image->GetPointData()->GetScalars();
    int size[3];
    image->GetDimensions(size);
    if (!scalars || scalars->GetNumberOfTuples() < 1)
    {
      throw InputError("the sweep has no pixels");
    }
    if (scalars->GetNumberOfComponents() != 1)
    {
      throw InputError("the sweep's pixels have " + std::to_string(scalars->GetNumberOfComponents()) +
                       " components; one is expected");
    }
    vtkFieldData* const fields = image->GetFieldData();
    vtkDataArray* const poses = bigus::FindArray(fields, "Sweep", "ImageToReference", 16, size[2], true);
    vtkDataArray* const timestamps = bigus::FindArray(fields, "Sweep", "Timestamp", 1, size[2], false);
    vtkDataArray* const status = bigus::FindArray(fields, "Sweep", "Status", 1, size[2], false);

    bigus::AtomicFile file(fileName);
    std::string header = "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\nBinaryData = True\n";
    header += std::string("BinaryDataByteOrderMSB = ") + (bigus::kThisMachineIsBigEndian ? "True\n" : "False\n");
    header += "CenterOfRotation = 0 0 0\n";
    header += std::string("CompressedData = ") + (this->Compression ? "True\n" : "False\n");
    const std::size_t sizeField = header.size() + std::string("CompressedDataSize = ").size();
    const std::size_t sizeDigits = 20;
    if (this->Compression)
    {
      header += "CompressedDataSize = " + std::string(sizeDigits, ' ') + "\n";  // filled in below
    }
    header += "DimSize = " + std::to_string(size[0]) + " " + std::to_string(size[1]) + " " + std::to_string(size[2]);
    header += "\nKinds = domain domain list\nElementNumberOfChannels = 1\nElementSpacing = 1 1 1\nElementType = ";
    header += ElementTypeName(scalars->GetDataType());
    header += "\nOffset = 0 0 0\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n";
    header += "UltrasoundImageOrientation = MF\nUltrasoundImageType = BRIGHTNESS\n";

    const std::string transform = std::string(this->FromFrame) + "To" + this->ToFrame + "Transform";
    for (int frame = 0; frame < size[2]; ++frame)
    {
      std::string number = std::to_string(frame);
      number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
      const std::string prefix = "Seq_Frame" + number + "_";
      const bool usable = !status || status->GetComponent(frame, 0) != 0;
      header += prefix + transform + " =";
      for (int c = 0; c < 16; ++c)
      {
        header += " " + bigus::ExactNumber(poses->GetComponent(frame, c));
      }
      header += "\n" + prefix + transform + "Status = " + (usable ? "OK\n" : "INVALID\n");
      if (timestamps)
      {
        header += prefix + "Timestamp = " + bigus::ExactNumber(timestamps->GetComponent(frame, 0)) + "\n";
      }
      header += prefix + "ImageStatus = OK\n";
    }
    header += "ElementDataFile = LOCAL\n";
    file.Write(header);

    const std::size_t frameBytes = static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
                                   static_cast<std::size_t>(scalars->GetDataTypeSize());
    const auto* const pixels = static_cast<const unsigned char*>(scalars->GetVoidPointer(0));
    std::unique_ptr<Deflater> deflater(this->Compression ? new Deflater(file) : nullptr);
    for (int frame = 0; frame < size[2]; ++frame)
    {
      const unsigned char* const bytes = pixels + static_cast<std::size_t>(frame) * frameBytes;
      deflater ? deflater->Write(bytes, frameBytes) : file.Write(bytes, frameBytes);
      if (!bigus::ReportProgress(this, (frame + 1.0) / size[2]))
      {
        this->SetErrorCode(vtkErrorCode::UserError);  // so that Write() does not say it has written
        return;
      }
    }
    if (deflater)
    {
      deflater->Finish();
      const std::uint64_t bytes = file.Position() - header.size();
      file.Seek(sizeField);
      file.Write(std::to_string(bytes));
    }
    file.Commit();
  }
  catch (const std::exception& error)
  {
    vtkErrorMacro(<< bigus::MessageOf(error));
    this->SetErrorCode(bigus::ErrorCodeOf(error));
  }
}

void vtkBigusSequenceWriter::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  const auto name = [](const char* text) { return text ? text : "(none)"; };
  os << indent << "FileName: " << name(this->FileName) << "\n";
  os << indent << "FromFrame: " << name(this->FromFrame) << "\n";
  os << indent << "ToFrame: " << name(this->ToFrame) << "\n";
  os << indent << "Compression: " << this->Compression << "\n";
}
