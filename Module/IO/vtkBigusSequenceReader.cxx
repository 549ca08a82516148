// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "vtkBigusSequenceReader.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "Core/Model/PixelMemory.h"
#include "Data/Arrays.h"
#include "Data/Progress.h"
#include "IO/ErrorCode.h"
#include "IO/FrameGeometry.h"
#include "IO/Poses.h"
#include "IO/SequenceFile.h"
#include "IO/SequenceFrames.h"
#include "IO/Text.h"
#include "IO/UnusedFields.h"
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

// What is known of each of `frames`; times only where all have one.
void AddFrameArrays(const bigus::PoseTable& poses, const std::vector<int>& frames, vtkFieldData* fields)
{
  const auto count = static_cast<vtkIdType>(frames.size());
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
}

}  // namespace

class vtkBigusSequenceReader::vtkInternals
{
public:
  bigus::SequenceFile file;
  bigus::PoseTable poses;
  bigus::FrameGeometry geometry;
  std::string summary;
  std::vector<std::string> transformNames;
  std::vector<bigus::UnusedField> unusedFields;
  std::string croppedFrame;
  std::string spacingDoubt;
  std::string pixelType;
  double usedRange = 0;
  bool isLoaded = false;  // all of the above, without an error
  bool hasTimestamps = false;
  double duration = 0;

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
    this->poses.RequireFrames(fileName);
    this->isLoaded = true;
  }

private:
  void Summarize(const std::string& fromFrame)
  {
    this->summary = this->poses.RejectionSummary();
    this->pixelType = this->file.PixelType();
    for (const auto& transform : this->poses.transforms)
    {
      this->transformNames.push_back(transform.Name());
    }
    this->unusedFields = bigus::UnusedFieldsOf(this->file, this->poses.transforms);
    this->croppedFrame = this->poses.CroppedFrame(fromFrame);
    this->spacingDoubt = bigus::SpacingDoubt(this->file, this->poses);
    if (!this->poses.chain.empty())
    {
      this->geometry = bigus::MeasureFrames(this->file, this->poses.frames);
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
  return fileName && bigus::IsSequence(fileName, !this->RequirePoses) ? 1 : 0;
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

  for (const std::string& caution :
       bigus::CautionsOf(this->FileName, this->Internals->file, options, this->Internals->poses))
  {
    vtkWarningMacro(<< caution);
  }
  const bigus::SequenceFile& file = this->Internals->file;
  const auto frames = static_cast<int>(this->Internals->poses.Kept(this->KeepRejectedFrames != 0).size());
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
  if (!this->Internals->isLoaded)
  {
    return 0;  // why was said when the file was opened; ParaView asks for data all the same
  }
  try
  {
    bigus::Clip shape;
    shape.shape = this->ClipMode == CLIP_RECTANGLE ? bigus::Clip::Shape::Rectangle
                  : this->ClipMode == CLIP_FAN     ? bigus::Clip::Shape::Fan
                                                   : bigus::Clip::Shape::None;
    std::copy_n(this->ClipRectangle, 4, shape.rectangle);
    std::copy_n(this->FanApex, 2, shape.apex);
    std::copy_n(this->FanRadii, 2, shape.radii);
    std::copy_n(this->FanAngles, 2, shape.angles);
    const std::vector<unsigned char> clip = bigus::ClipMask(file, shape);

    const std::vector<int> frames = poses.Kept(this->KeepRejectedFrames != 0);
    const auto count = static_cast<vtkIdType>(frames.size());
    const auto pixelsPerFrame = static_cast<vtkIdType>(file.width) * static_cast<vtkIdType>(file.height);

    output->SetExtent(0, file.width - 1, 0, file.height - 1, 0, static_cast<int>(count) - 1);
    output->SetOrigin(0, 0, 0);
    output->SetSpacing(1, 1, 1);
    auto scalars = vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(VtkType(file.elementType)));
    scalars->SetName("Intensity");
    scalars->SetVoidArray(bigus::NewPixels(file.FrameBytes() * static_cast<std::size_t>(count)), pixelsPerFrame * count,
                          0, vtkAbstractArray::VTK_DATA_ARRAY_USER_DEFINED);
    scalars->SetArrayFreeFunction(bigus::FreePixels);
    bigus::ReadPixels read;
    const auto goOn = [this](double share) { return bigus::ReportProgress(this, share); };
    if (!bigus::ReadFrames(file, poses, frames, clip, this->PixelRange, goOn,
                           static_cast<unsigned char*>(scalars->GetVoidPointer(0)), read))
    {
      output->Initialize();
      return 1;
    }
    this->Internals->usedRange = read.usedRange;
    if (read.usedBits > 0)
    {
      vtkWarningMacro(<< bigus::UsedBitsWarning(file, read));
    }
    output->GetPointData()->SetScalars(scalars);

    AddFrameArrays(poses, frames, output->GetFieldData());
    if (this->AutoMask || !clip.empty())
    {
      const auto mask = bigus::NewArray<vtkUnsignedCharArray>("Mask", 1, pixelsPerFrame);
      const std::vector<unsigned char>& values = this->AutoMask ? read.lit : clip;
      std::copy(values.begin(), values.end(), mask->GetPointer(0));
      output->GetFieldData()->AddArray(mask);
    }
  }
  catch (const std::exception& error)
  {
    output->Initialize();
    return this->Fail(error);
  }
  return 1;
}

// What is known of the file.
#define vtkBigusFoundMacro(type, name, value) \
  type vtkBigusSequenceReader::Get##name()    \
  {                                           \
    return this->Internals->value;            \
  }
vtkBigusFoundMacro(int, NumberOfFramesInFile, file.numberOfFrames);
vtkBigusFoundMacro(int, NumberOfAcceptedFrames, poses.NumberOfAcceptedFrames());
vtkBigusFoundMacro(const char*, RejectionSummary, summary.c_str());
vtkBigusFoundMacro(const char*, CroppedFrame, croppedFrame.c_str());
vtkBigusFoundMacro(int, NumberOfMadeAxes, poses.NumberOfMadeAxes());
vtkBigusFoundMacro(const char*, SpacingDoubt, spacingDoubt.c_str());
vtkBigusFoundMacro(double, UsedPixelRange, usedRange);
vtkBigusFoundMacro(const char*, TransformChain, poses.chain.c_str());
vtkBigusFoundMacro(const char*, Format, file.format.c_str());
vtkBigusFoundMacro(const char*, ElementType, pixelType.c_str());
vtkBigusFoundMacro(const char*, Orientation, file.orientation.c_str());
vtkBigusFoundMacro(double, PathLength, geometry.pathLength);
vtkBigusFoundMacro(bool, HasTimestamps, hasTimestamps);
vtkBigusFoundMacro(double, Duration, duration);
#undef vtkBigusFoundMacro

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

int vtkBigusSequenceReader::GetNumberOfUnusedFields()
{
  return static_cast<int>(this->Internals->unusedFields.size());
}

const char* vtkBigusSequenceReader::GetUnusedFieldName(int index)
{
  return index >= 0 && index < this->GetNumberOfUnusedFields()
             ? this->Internals->unusedFields[static_cast<std::size_t>(index)].name.c_str()
             : nullptr;
}

const char* vtkBigusSequenceReader::GetUnusedFieldValue(int index)
{
  return index >= 0 && index < this->GetNumberOfUnusedFields()
             ? this->Internals->unusedFields[static_cast<std::size_t>(index)].value.c_str()
             : nullptr;
}

int vtkBigusSequenceReader::GetUnusedFieldCount(int index)
{
  return index >= 0 && index < this->GetNumberOfUnusedFields()
             ? this->Internals->unusedFields[static_cast<std::size_t>(index)].count
             : 0;
}

void vtkBigusSequenceReader::GetHeaderSpacing(double spacing[2])
{
  std::copy_n(this->Internals->file.spacing.begin(), 2, spacing);
}

const char* vtkBigusSequenceReader::GetEncoding()
{
  return bigus::NameOf(this->Internals->file.encoding);
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
  spacing[1] = planes.usualSpacing;
  spacing[2] = planes.largestSpacing;
}

void vtkBigusSequenceReader::GetBounds(double bounds[6])
{
  std::copy_n(this->Internals->geometry.bounds, 6, bounds);
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
