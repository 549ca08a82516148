// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSequenceReader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "Core/Model/SweepGeometry.h"
#include "Core/Numerics/Constants.h"
#include "Data/Arrays.h"
#include "Data/Progress.h"
#include "IO/FileError.h"
#include "IO/Formats/PngFile.h"
#include "IO/Poses.h"
#include "IO/SequenceFile.h"
#include "IO/Text.h"
#include "vtkDataArray.h"
#include "vtkDoubleArray.h"
#include "vtkFieldData.h"
#include "vtkImageData.h"
#include "vtkInformation.h"
#include "vtkInformationVector.h"
#include "vtkIntArray.h"
#include "vtkObjectFactory.h"
#include "vtkPointData.h"
#include "vtkSmartPointer.h"
#include "vtkStreamingDemandDrivenPipeline.h"
#include "vtkUnsignedCharArray.h"

vtkStandardNewMacro(vtkBigusSequenceReader);

namespace
{

std::string Text(const char* text)
{
  return text ? text : "";
}

int VtkType(bigus::ElementType type)
{
  return type == bigus::ElementType::UInt8    ? VTK_UNSIGNED_CHAR
         : type == bigus::ElementType::UInt16 ? VTK_UNSIGNED_SHORT
                                              : VTK_FLOAT;
}

// Where the accepted frames lie, mm.
struct FrameGeometry
{
  double pixelSize[2] = {0, 0};  // mean over frames
  bigus::SweepGeometry planes;   // as the trainer measures it
  double pathLength = 0;         // of the frames' centres
  double bounds[6] = {0, 0, 0, 0, 0, 0};
};

FrameGeometry Measure(const bigus::SequenceFile& file, const std::vector<bigus::FramePose>& frames)
{
  FrameGeometry geometry;
  bigus::Sweep sweep;  // without pixels
  sweep.width = file.width;
  sweep.height = file.height;
  for (const bigus::FramePose& frame : frames)
  {
    if (frame.accepted)
    {
      sweep.imageToReference.push_back(frame.imageToReference);
    }
  }
  const int accepted = sweep.NumberOfFrames();
  if (accepted == 0)
  {
    return geometry;
  }
  const double i = file.width - 1;
  const double j = file.height - 1;
  Eigen::AlignedBox3d box;
  for (int k = 0; k < accepted; ++k)
  {
    const bigus::SlicePlane plane = sweep.Plane(k);
    geometry.pixelSize[0] += plane.columnStep.norm() / accepted;
    geometry.pixelSize[1] += plane.rowStep.norm() / accepted;
    box.extend(plane.Point(0, 0)).extend(plane.Point(i, 0)).extend(plane.Point(0, j)).extend(plane.Point(i, j));
    if (k > 0)
    {
      geometry.pathLength += (plane.Point(0.5 * i, 0.5 * j) - sweep.Plane(k - 1).Point(0.5 * i, 0.5 * j)).norm();
    }
  }
  for (int axis = 0; axis < 3; ++axis)
  {
    geometry.bounds[2 * axis] = box.min()[axis];
    geometry.bounds[2 * axis + 1] = box.max()[axis];
  }
  std::vector<int> all(static_cast<std::size_t>(accepted));
  std::iota(all.begin(), all.end(), 0);
  geometry.planes = bigus::MeasureGeometry(sweep, all);
  return geometry;
}

// [rows][columns] 1 where `inside(i, j)`.
template <class Inside>
std::vector<unsigned char> ClipMask(int width, int height, const Inside& inside)
{
  std::vector<unsigned char> mask(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  auto pixel = mask.begin();
  for (std::int64_t j = 0; j < height; ++j)
  {
    for (std::int64_t i = 0; i < width; ++i)
    {
      *pixel++ = inside(i, j);
    }
  }
  return mask;
}

// Angles in degrees from +j towards +i.
std::vector<unsigned char> FanMask(int width, int height, const double apex[2], const double radii[2],
                                   const double angles[2])
{
  return ClipMask(width, height,
                  [=](double i, double j)
                  {
                    const double radius = std::hypot(i - apex[0], j - apex[1]);
                    const double angle = std::atan2(i - apex[0], j - apex[1]) * (180.0 / bigus::kPi);
                    return radius >= radii[0] && radius <= radii[1] && angle >= angles[0] && angle <= angles[1];
                  });
}

std::vector<unsigned char> RectangleMask(int width, int height, const int rectangle[4])
{
  return ClipMask(width, height,
                  [=](std::int64_t i, std::int64_t j)
                  {
                    return i >= rectangle[0] && i - rectangle[0] < rectangle[2] && j >= rectangle[1] &&
                           j - rectangle[1] < rectangle[3];
                  });
}

// One frame from the file's pixel order to marked-far order.
void Reorder(const bigus::SequenceFile& file, const unsigned char* from, unsigned char* to)
{
  const std::size_t bytes = bigus::BytesPerElement(file.elementType);
  const auto width = static_cast<std::size_t>(file.width);
  const auto height = static_cast<std::size_t>(file.height);
  for (std::size_t j = 0; j < height; ++j)
  {
    const unsigned char* row = from + (file.flipRows ? height - 1 - j : j) * width * bytes;
    unsigned char* out = to + j * width * bytes;
    if (!file.flipColumns)
    {
      std::memcpy(out, row, width * bytes);
      continue;
    }
    for (std::size_t i = 0; i < width; ++i)
    {
      std::memcpy(out + i * bytes, row + (width - 1 - i) * bytes, bytes);
    }
  }
}

// Reads a sequence whose list axis comes first. `place` says where each frame goes in `pixels`, or -1. False
// when the user wants to stop.
bool ReadInterleaved(vtkAlgorithm* reader, const bigus::SequenceFile& file, const std::vector<int>& place,
                     unsigned char* pixels)
{
  const std::size_t bytes = bigus::BytesPerElement(file.elementType);
  const std::size_t frames = place.size();
  const auto width = static_cast<std::size_t>(file.width);
  const auto height = static_cast<std::size_t>(file.height);
  bigus::PixelStream stream(file);
  std::vector<unsigned char> row(frames * width * bytes);
  for (std::size_t j = 0; j < height; ++j)
  {
    stream.Read(row.data(), row.size());
    for (std::size_t frame = 0; frame < frames; ++frame)
    {
      for (std::size_t i = 0; place[frame] >= 0 && i < width; ++i)
      {
        std::memcpy(pixels + ((static_cast<std::size_t>(place[frame]) * height + j) * width + i) * bytes,
                    &row[(i * frames + frame) * bytes], bytes);
      }
    }
    if (!bigus::ReportProgress(reader,
                               0.5 * static_cast<double>(j + 1) /
                                   static_cast<double>(height)))  // the other half is for sorting the pixels out
    {
      return false;
    }
  }
  stream.Finish();
  return true;
}

// Blackens what the mask leaves out and notes what is lit. A float pixel of any sign of zero is black. One loop a pixel
// type: where one loop took all types, GCC read 4 bytes for pixels of 1 byte, past the end of the last frame.
template <class Pixel>
void ClipAndNotePixels(const std::vector<unsigned char>& clip, Pixel* frame, std::size_t pixels, unsigned char* lit)
{
  for (std::size_t p = 0; p < pixels; ++p)
  {
    if (!clip.empty() && !clip[p])
    {
      frame[p] = 0;
    }
    lit[p] |= frame[p] != 0;
  }
}

void ClipAndNote(const bigus::SequenceFile& file, const std::vector<unsigned char>& clip, unsigned char* frame,
                 unsigned char* lit)
{
  const std::size_t pixels = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
  switch (file.elementType)
  {
    case bigus::ElementType::Float32:
      return ClipAndNotePixels(clip, reinterpret_cast<float*>(frame), pixels, lit);
    case bigus::ElementType::UInt16:
      return ClipAndNotePixels(clip, reinterpret_cast<std::uint16_t*>(frame), pixels, lit);
    default:
      return ClipAndNotePixels(clip, frame, pixels, lit);
  }
}

// How many of an unsigned short's highest bits no pixel has, of data that have 8, 10, 12 or 14 bits; else 0. Pixels below
// kDimmest would make the number of bits a guess.
int UnusedBits(vtkDataArray* pixels)
{
  constexpr int kDimmest = 64;
  if (pixels->GetDataType() != VTK_UNSIGNED_SHORT)
  {
    return 0;
  }
  const auto* first = static_cast<const unsigned short*>(pixels->GetVoidPointer(0));
  const vtkIdType count = pixels->GetNumberOfTuples();
  const int largest = count > 0 ? *std::max_element(first, first + count) : 0;
  int bits = 8;
  while (largest >= 1 << bits)
  {
    bits += 2;
  }
  return largest < kDimmest ? 0 : 16 - bits;
}

// Makes `range` the largest pixel of the type. Throws FileError where a pixel is larger.
template <class Pixel>
void ScalePixels(const bigus::SequenceFile& file, Pixel* pixels, vtkIdType count, double range, double white)
{
  for (vtkIdType p = 0; p < count; ++p)
  {
    const double pixel = pixels[p];
    if (pixel > range)
    {
      throw bigus::FormatError(file.fileName + ": has the pixel " + bigus::ExactNumber(pixel) +
                               ", above the pixel range of " + bigus::ExactNumber(range));
    }
    const double scaled = pixel * (white / range);
    pixels[p] = static_cast<Pixel>(white > 1 ? std::round(scaled) : scaled);
  }
}

void Scale(const bigus::SequenceFile& file, vtkDataArray* pixels, double range)
{
  void* const first = pixels->GetVoidPointer(0);
  const vtkIdType count = pixels->GetNumberOfTuples();
  switch (file.elementType)
  {
    case bigus::ElementType::Float32:
      return ScalePixels(file, static_cast<float*>(first), count, range, 1);
    case bigus::ElementType::UInt16:
      return ScalePixels(file, static_cast<unsigned short*>(first), count, range, 65535);
    default:
      return ScalePixels(file, static_cast<unsigned char*>(first), count, range, 255);
  }
}

}  // namespace

class vtkBigusSequenceReader::vtkInternals
{
public:
  bigus::SequenceFile file;
  bigus::PoseTable poses;
  FrameGeometry geometry;
  std::string summary;
  std::vector<std::string> transformNames;
  std::string croppedFrame;
  std::string pixelType;
  double usedRange = 0;
  bool hasTimestamps = false;
  double duration = 0;

  // The frames that the output holds, by their index in the file.
  std::vector<int> OutputFrames(bool keepRejected) const
  {
    std::vector<int> frames;
    for (std::size_t i = 0; i < this->poses.frames.size(); ++i)
    {
      if (keepRejected || this->poses.frames[i].accepted)
      {
        frames.push_back(static_cast<int>(i));
      }
    }
    return frames;
  }

  void Load(const std::string& fileName, const bigus::ImageOptions& images, const bigus::PoseOptions& options)
  {
    *this = vtkInternals();
    this->file = bigus::ReadSequenceFile(fileName, images);
    try
    {
      bigus::ResolvePoses(this->file, options, this->poses);
    }
    catch (...)
    {
      this->Summarize(options.fromFrame);
      throw;
    }
    this->Summarize(options.fromFrame);
    if (this->poses.NumberOfAcceptedFrames() == 0)
    {
      throw bigus::FormatError(fileName + ": no frame is left: " + this->summary);
    }
  }

private:
  void Summarize(const std::string& fromFrame)
  {
    this->summary = this->poses.RejectionSummary();
    this->pixelType = this->file.PixelType();
    for (const auto& transform : this->poses.transforms)
    {
      this->transformNames.push_back(transform.Name());
      for (const std::string& frame : {transform.from, transform.to})
      {
        if (frame == "Cropped" + fromFrame)
        {
          this->croppedFrame = frame;
        }
      }
    }
    if (!this->poses.chain.empty())
    {
      this->geometry = Measure(this->file, this->poses.frames);
    }

    double first = 0;
    double last = 0;
    int accepted = 0;
    this->hasTimestamps = true;
    for (std::size_t i = 0; i < this->poses.frames.size(); ++i)
    {
      if (this->poses.frames[i].accepted)
      {
        last = this->poses.timestamps[i];
        first = accepted++ == 0 ? last : first;
        this->hasTimestamps = this->hasTimestamps && std::isfinite(last);
      }
    }
    this->hasTimestamps = this->hasTimestamps && accepted > 0;
    this->duration = this->hasTimestamps ? last - first : 0;
  }
};

vtkBigusSequenceReader::vtkBigusSequenceReader() : Internals(new vtkInternals) {}

vtkBigusSequenceReader::~vtkBigusSequenceReader()
{
  this->SetImageFolder(nullptr);
  this->SetImagePattern(nullptr);
  delete this->Internals;
}

vtkImageData* vtkBigusSequenceReader::GetOutput()
{
  return vtkImageData::SafeDownCast(this->GetOutputDataObject(0));
}

int vtkBigusSequenceReader::FillOutputPortInformation(int, vtkInformation* info)
{
  info->Set(vtkDataObject::DATA_TYPE_NAME(), "vtkImageData");
  return 1;
}

int vtkBigusSequenceReader::CanReadFile(const char* fileName)
{
  const bool plain = !this->RequirePoses;
  return fileName && bigus::LooksLikeSequence(bigus::FileBeginning(fileName, 4096), plain) ? 1 : 0;
}

int vtkBigusSequenceReader::RequestInformation(vtkInformation*, vtkInformationVector**,
                                               vtkInformationVector* outputVector)
{
  this->SetErrorCode(vtkErrorCode::NoError);
  *this->Internals = vtkInternals();
  bigus::PoseOptions options;
  try
  {
    const std::string fileName = this->RequireFileName();
    bigus::ImageOptions images;
    images.folder = Text(this->ImageFolder);
    images.pattern = Text(this->ImagePattern);
    images.plain = !this->RequirePoses;
    options = this->GetPoseOptions();
    options.required = this->RequirePoses != 0;
    this->Internals->Load(fileName, images, options);
  }
  catch (const std::exception& error)
  {
    this->GetOutput()->Initialize();
    return this->Fail(error);
  }

  if (!this->Internals->croppedFrame.empty())
  {
    vtkWarningMacro(<< this->FileName << ": poses lead from " << options.fromFrame << ", but the transforms name "
                    << this->Internals->croppedFrame
                    << ", too. Where the images are the cropped ones, name that coordinate frame instead");
  }
  const bigus::SequenceFile& file = this->Internals->file;
  const auto frames = static_cast<int>(this->Internals->OutputFrames(this->KeepRejectedFrames != 0).size());
  const int extent[6] = {0, file.width - 1, 0, file.height - 1, 0, frames - 1};
  const double ones[3] = {1, 1, 1};
  const double zeros[3] = {0, 0, 0};
  vtkInformation* const info = outputVector->GetInformationObject(0);
  info->Set(vtkStreamingDemandDrivenPipeline::WHOLE_EXTENT(), extent, 6);
  info->Set(vtkDataObject::SPACING(), ones, 3);
  info->Set(vtkDataObject::ORIGIN(), zeros, 3);
  vtkDataObject::SetPointDataActiveScalarInfo(info, VtkType(file.elementType), 1);
  return 1;
}

int vtkBigusSequenceReader::RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector* outputVector)
{
  vtkImageData* const output = vtkImageData::GetData(outputVector, 0);
  const bigus::SequenceFile& file = this->Internals->file;
  const bigus::PoseTable& poses = this->Internals->poses;
  output->Initialize();
  try
  {
    std::vector<unsigned char> clip;
    if (this->ClipMode == CLIP_RECTANGLE)
    {
      clip = RectangleMask(file.width, file.height, this->ClipRectangle);
    }
    else if (this->ClipMode == CLIP_FAN)
    {
      if (!(this->FanRadii[0] >= 0 && this->FanRadii[0] < this->FanRadii[1] && this->FanAngles[0] >= -180 &&
            this->FanAngles[0] < this->FanAngles[1] && this->FanAngles[1] <= 180))
      {
        throw bigus::FileError(vtkErrorCode::UserError,
                               "the clip fan needs 0 <= inner < outer radius and -180 <= first < last <= 180 degrees");
      }
      clip = FanMask(file.width, file.height, this->FanApex, this->FanRadii, this->FanAngles);
    }
    if (!clip.empty() && std::find(clip.begin(), clip.end(), 1) == clip.end())
    {
      throw bigus::FileError(vtkErrorCode::UserError, "the clip shape leaves no pixel of the " +
                                                          std::to_string(file.width) + " x " +
                                                          std::to_string(file.height) + " image");
    }

    const std::vector<int> frames = this->Internals->OutputFrames(this->KeepRejectedFrames != 0);
    const auto count = static_cast<vtkIdType>(frames.size());
    const auto pixelsPerFrame = static_cast<std::size_t>(file.width) * static_cast<std::size_t>(file.height);
    const auto frameBytes = static_cast<std::size_t>(file.FrameBytes());

    output->SetExtent(0, file.width - 1, 0, file.height - 1, 0, static_cast<int>(count) - 1);
    output->SetOrigin(0, 0, 0);
    output->SetSpacing(1, 1, 1);
    auto scalars = vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(VtkType(file.elementType)));
    scalars->SetName("Intensity");
    scalars->SetNumberOfTuples(static_cast<vtkIdType>(pixelsPerFrame) * count);
    auto* const pixels = static_cast<unsigned char*>(scalars->GetVoidPointer(0));
    std::vector<unsigned char> lit(pixelsPerFrame, 0);

    // Where a frame of the file goes in the output, or -1.
    std::vector<int> place(poses.frames.size(), -1);
    for (std::size_t i = 0; i < frames.size(); ++i)
    {
      place[static_cast<std::size_t>(frames[i])] = static_cast<int>(i);
    }

    if (file.framesFastest && !ReadInterleaved(this, file, place, pixels))
    {
      output->Initialize();
      return 1;
    }

    // Frames are read where they belong, unless they have to be turned or are not wanted.
    const bool turned = file.flipColumns || file.flipRows;
    std::vector<unsigned char> buffer(frameBytes);
    const bool streamed = file.encoding != bigus::Encoding::Png && !file.framesFastest;
    std::unique_ptr<bigus::PixelStream> stream(streamed ? new bigus::PixelStream(file) : nullptr);
    for (std::size_t i = 0; i < place.size(); ++i)
    {
      unsigned char* const target = place[i] < 0 ? nullptr : pixels + static_cast<std::size_t>(place[i]) * frameBytes;
      unsigned char* const read = target && !turned ? target : buffer.data();
      if (streamed)
      {
        stream->Read(read, frameBytes);
      }
      if (target)
      {
        if (!streamed && !file.framesFastest)
        {
          const bigus::PngHeader expected = {file.width, file.height, file.elementType};
          bigus::ReadPng(file.images[i], expected, read);
        }
        if (turned)
        {
          if (file.framesFastest)
          {
            std::memcpy(read, target, frameBytes);
          }
          Reorder(file, read, target);
        }
        // Rejected frames are clipped too, but do not light the mask.
        std::vector<unsigned char> ignored(poses.frames[i].accepted ? 0 : pixelsPerFrame);
        ClipAndNote(file, clip, target, ignored.empty() ? lit.data() : ignored.data());
      }
      const double share = static_cast<double>(i + 1) / static_cast<double>(place.size());
      if (!bigus::ReportProgress(this, file.framesFastest ? 0.5 + 0.5 * share : share))
      {
        output->Initialize();
        return 1;
      }
    }
    if (stream)
    {
      stream->Finish();
    }
    this->Internals->usedRange = this->PixelRange;
    if (const int bits = this->PixelRange > 0 ? 0 : UnusedBits(scalars))
    {
      this->Internals->usedRange = (1 << (16 - bits)) - 1;
      vtkWarningMacro(
          << file.fileName << ": the pixels use " << 16 - bits << " of 16 bits, so " << this->Internals->usedRange
          << " is shown as white. Where that is wrong, set the pixel range; 65535 keeps pixels as they are");
    }
    if (this->Internals->usedRange > 0)
    {
      Scale(file, scalars, this->Internals->usedRange);
    }
    output->GetPointData()->SetScalars(scalars);

    const auto imageToReference = bigus::NewArray<vtkDoubleArray>("ImageToReference", 16, count);
    const auto status = bigus::NewArray<vtkUnsignedCharArray>("Status", 1, count);
    const auto sourceFrame = bigus::NewArray<vtkIntArray>("SourceFrame", 1, count);
    const auto timestamp = bigus::NewArray<vtkDoubleArray>("Timestamp", 1, count);
    bool allTimed = true;
    for (vtkIdType i = 0; i < count; ++i)
    {
      const auto source = static_cast<std::size_t>(frames[static_cast<std::size_t>(i)]);
      for (int c = 0; c < 16; ++c)
      {
        imageToReference->SetComponent(i, c, poses.frames[source].imageToReference(c / 4, c % 4));
      }
      status->SetValue(i, poses.frames[source].accepted);
      sourceFrame->SetValue(i, static_cast<int>(source));
      timestamp->SetValue(i, poses.timestamps[source]);
      allTimed = allTimed && std::isfinite(poses.timestamps[source]);
    }
    vtkFieldData* const fields = output->GetFieldData();
    if (!poses.chain.empty())
    {
      fields->AddArray(imageToReference);
    }
    fields->AddArray(status);
    fields->AddArray(sourceFrame);
    if (allTimed)
    {
      fields->AddArray(timestamp);
    }
    if (this->AutoMask || !clip.empty())
    {
      const auto mask = bigus::NewArray<vtkUnsignedCharArray>("Mask", 1, static_cast<vtkIdType>(pixelsPerFrame));
      const std::vector<unsigned char>& values = this->AutoMask ? lit : clip;
      std::copy(values.begin(), values.end(), mask->GetPointer(0));
      fields->AddArray(mask);
    }
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    return this->Fail(error);
  }
  return 1;
}

int vtkBigusSequenceReader::GetNumberOfFramesInFile()
{
  return this->Internals->file.numberOfFrames;
}

int vtkBigusSequenceReader::GetNumberOfAcceptedFrames()
{
  return this->Internals->poses.NumberOfAcceptedFrames();
}

int vtkBigusSequenceReader::GetNumberOfRejectedFrames()
{
  return static_cast<int>(this->Internals->poses.frames.size()) - this->GetNumberOfAcceptedFrames();
}

int vtkBigusSequenceReader::GetNumberOfRejectionReasons()
{
  return static_cast<int>(this->Internals->poses.rejections.size());
}

const char* vtkBigusSequenceReader::GetRejectionReason(int index)
{
  return index >= 0 && index < this->GetNumberOfRejectionReasons()
             ? this->Internals->poses.rejections[static_cast<std::size_t>(index)].reason.c_str()
             : nullptr;
}

int vtkBigusSequenceReader::GetRejectionCount(int index)
{
  return index >= 0 && index < this->GetNumberOfRejectionReasons()
             ? static_cast<int>(this->Internals->poses.rejections[static_cast<std::size_t>(index)].frames.size())
             : 0;
}

const char* vtkBigusSequenceReader::GetRejectionSummary()
{
  return this->Internals->summary.c_str();
}

int vtkBigusSequenceReader::GetNumberOfTransforms()
{
  return static_cast<int>(this->Internals->poses.transforms.size());
}

const char* vtkBigusSequenceReader::GetTransformName(int index)
{
  return index >= 0 && index < this->GetNumberOfTransforms()
             ? this->Internals->transformNames[static_cast<std::size_t>(index)].c_str()
             : nullptr;
}

const char* vtkBigusSequenceReader::GetTransformSource(int index)
{
  return index >= 0 && index < this->GetNumberOfTransforms()
             ? this->Internals->poses.transforms[static_cast<std::size_t>(index)].source.c_str()
             : nullptr;
}

const char* vtkBigusSequenceReader::GetCroppedFrame()
{
  return this->Internals->croppedFrame.c_str();
}

double vtkBigusSequenceReader::GetUsedPixelRange()
{
  return this->Internals->usedRange;
}

const char* vtkBigusSequenceReader::GetTransformChain()
{
  return this->Internals->poses.chain.c_str();
}

const char* vtkBigusSequenceReader::GetFormat()
{
  return this->Internals->file.format.c_str();
}

const char* vtkBigusSequenceReader::GetEncoding()
{
  return bigus::NameOf(this->Internals->file.encoding);
}

const char* vtkBigusSequenceReader::GetElementType()
{
  return this->Internals->pixelType.c_str();
}

const char* vtkBigusSequenceReader::GetOrientation()
{
  return this->Internals->file.orientation.c_str();
}

void vtkBigusSequenceReader::GetFrameSize(int size[2])
{
  size[0] = this->Internals->file.width;
  size[1] = this->Internals->file.height;
}

void vtkBigusSequenceReader::GetPixelSize(double size[2])
{
  std::copy_n(this->Internals->geometry.pixelSize, 2, size);
}

void vtkBigusSequenceReader::GetPlaneSpacing(double spacing[3])
{
  const bigus::SweepGeometry& planes = this->Internals->geometry.planes;
  spacing[0] = planes.smallestSpacing;
  spacing[1] = planes.medianSpacing;
  spacing[2] = planes.largestSpacing;
}

double vtkBigusSequenceReader::GetPathLength()
{
  return this->Internals->geometry.pathLength;
}

void vtkBigusSequenceReader::GetBounds(double bounds[6])
{
  std::copy_n(this->Internals->geometry.bounds, 6, bounds);
}

bool vtkBigusSequenceReader::GetHasTimestamps()
{
  return this->Internals->hasTimestamps;
}

double vtkBigusSequenceReader::GetDuration()
{
  return this->Internals->duration;
}

void vtkBigusSequenceReader::PrintSelf(ostream& os, vtkIndent indent)
{
  this->Superclass::PrintSelf(os, indent);
  const auto name = [](const char* text) { return text ? text : "(none)"; };
  os << indent << "RequirePoses: " << this->RequirePoses << "\n";
  os << indent << "KeepRejectedFrames: " << this->KeepRejectedFrames << "\n";
  os << indent << "PixelRange: " << this->PixelRange << "\n";
  os << indent << "AutoMask: " << this->AutoMask << "\n";
  os << indent << "ClipMode: " << this->ClipMode << "\n";
  os << indent << "ClipRectangle: " << this->ClipRectangle[0] << " " << this->ClipRectangle[1] << " "
     << this->ClipRectangle[2] << " " << this->ClipRectangle[3] << "\n";
  os << indent << "FanApex: " << this->FanApex[0] << " " << this->FanApex[1] << "\n";
  os << indent << "FanRadii: " << this->FanRadii[0] << " " << this->FanRadii[1] << "\n";
  os << indent << "FanAngles: " << this->FanAngles[0] << " " << this->FanAngles[1] << "\n";
  os << indent << "ImageFolder: " << name(this->ImageFolder) << "\n";
  os << indent << "ImagePattern: " << name(this->ImagePattern) << "\n";
  os << indent << "TransformChain: " << this->GetTransformChain() << "\n";
  os << indent << "RejectionSummary: " << this->GetRejectionSummary() << "\n";
}
