// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Sequences, fields and slice planes in files, by the parsers of Module/IO.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "Arrays.h"
#include "Core/Model/PixelMemory.h"
#include "Core/Model/SlicePlane.h"
#include "Core/Model/Sweep.h"
#include "IO/FrameGeometry.h"
#include "IO/PlaneFile.h"
#include "IO/SequenceFrames.h"
#include "IO/SequenceOutput.h"
#include "IO/Text.h"
#include "Progress.h"

namespace bigus
{
namespace
{

/// A setting by its name in settings.py.
template <class Value>
Value Given(const nb::kwargs& settings, const char* name)
{
  return nb::cast<Value>(settings[name]);
}

PoseOptions PoseOptionsOf(const nb::kwargs& settings)
{
  return {Given<std::string>(settings, "FromFrame"),      Given<std::string>(settings, "ToFrame"),
          Given<std::string>(settings, "ConfigFileName"), Given<std::array<double, 2>>(settings, "ImageSpacing"),
          Given<bool>(settings, "AssumeMissingStatusOK"), Given<bool>(settings, "AllowReflectedPoses")};
}

Clip ClipOf(const nb::kwargs& settings)
{
  const int mode = Given<int>(settings, "ClipMode");
  const auto rectangle = Given<std::array<int, 4>>(settings, "ClipRectangle");
  const auto apex = Given<std::array<double, 2>>(settings, "FanApex");
  const auto radii = Given<std::array<double, 2>>(settings, "FanRadii");
  const auto angles = Given<std::array<double, 2>>(settings, "FanAngles");
  return {mode == 1   ? Clip::Shape::Rectangle
          : mode == 2 ? Clip::Shape::Fan
                      : Clip::Shape::None,
          {rectangle[0], rectangle[1], rectangle[2], rectangle[3]},
          {apex[0], apex[1]},
          {radii[0], radii[1]},
          {angles[0], angles[1]}};
}

template <class Pixel>
Array PixelsOf(const std::shared_ptr<unsigned char>& bytes, const SequenceFile& file, std::size_t frames)
{
  auto* kept = new std::shared_ptr<unsigned char>(bytes);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::shared_ptr<unsigned char>*>(p); });
  return View(reinterpret_cast<Pixel*>(kept->get()),
              {frames, static_cast<std::size_t>(file.height), static_cast<std::size_t>(file.width)}, owner);
}

/// What was read of a sequence.
struct ReadFile
{
  SequenceFile file;
  PoseTable poses;
  std::vector<int> frames;  // that are kept
  std::shared_ptr<unsigned char> bytes;
  std::vector<unsigned char> shape;  // of the clip; empty: none
  ReadPixels read;
};

ReadFile Read(const std::string& path, const PoseOptions& options, const ImageOptions& images, const Clip& clip,
              bool keepsRejected, double pixelRange)
{
  const auto read = [&](PythonProgress& goOn)
  {
    ReadFile found;
    SequenceFile& file = found.file;
    file = ReadSequenceFile(path, images);
    ResolvePoses(file, options, found.poses);
    found.poses.RequireFrames(path);
    found.shape = ClipMask(file, clip);
    found.frames = found.poses.Kept(keepsRejected);
    found.bytes = AllocatePixels<unsigned char>(static_cast<std::size_t>(file.FrameBytes()) * found.frames.size());
    ReadFrames(file, found.poses, found.frames, found.shape, std::max(0.0, pixelRange), std::ref(goOn),
               found.bytes.get(), found.read);
    return found;
  };
  return WorkAlone(nb::none(), read);
}

/// The times of frames; none unless all have one.
std::optional<Array> TimesOf(std::vector<double> times)
{
  const bool areAll = std::all_of(times.begin(), times.end(), [](double time) { return std::isfinite(time); });
  return areAll ? std::optional(Owned(std::move(times))) : std::nullopt;
}

/// What a filter tells of a sequence besides its arrays.
void PutFacts(nb::dict& answer, const ReadFile& found)
{
  const auto& [file, poses, frames, bytes, shape, read] = found;
  const FrameGeometry geometry = poses.chain.empty() ? FrameGeometry() : MeasureFrames(file, poses.frames);
  const auto& [i, j] = geometry.pixelSize;
  const SweepGeometry& planes = geometry.planes;
  const auto& b = geometry.bounds;
  Put(answer, "frames_in_file", poses.frames.size(), "accepted_frames", poses.NumberOfAcceptedFrames(),
      "rejection_summary", ToText(poses.RejectionSummary()), "transform_chain", ToText(poses.chain), "format",
      ToText(file.format), "encoding", NameOf(file.encoding), "element_type", file.PixelType(), "orientation",
      ToText(file.orientation), "spacing_doubt", ToText(SpacingDoubt(file, poses)), "used_pixel_range", read.usedRange,
      "made_axes", poses.NumberOfMadeAxes(), "frame_size", nb::make_tuple(file.width, file.height), "pixel_size",
      nb::make_tuple(i, j), "plane_spacing",
      nb::make_tuple(planes.smallestSpacing, planes.usualSpacing, planes.largestSpacing), "path_length",
      geometry.pathLength, "bounds", nb::make_tuple(b[0], b[1], b[2], b[3], b[4], b[5]));
}

/// A sequence as it is in the file, with what is known of it.
nb::dict ReadSequence(const std::string& path, const nb::kwargs& settings)
{
  const bool requirePoses = Given<bool>(settings, "RequirePoses");
  ImageOptions images;
  images.folder = Given<std::string>(settings, "ImageFolder");
  images.pattern = Given<std::string>(settings, "ImagePattern");
  images.plain = !requirePoses;
  PoseOptions options = PoseOptionsOf(settings);
  options.required = requirePoses;
  ReadFile found = Read(path, options, images, ClipOf(settings), Given<bool>(settings, "KeepRejectedFrames"),
                        Given<double>(settings, "PixelRange"));
  const SequenceFile& file = found.file;
  const std::size_t n = found.frames.size();
  std::vector<Eigen::Matrix4d> matrices;
  std::vector<double> times;
  std::vector<std::uint8_t> status;
  for (const int frame : found.frames)
  {
    const FramePose& pose = found.poses.frames[static_cast<std::size_t>(frame)];
    matrices.push_back(pose.imageToReference);
    times.push_back(found.poses.timestamps[static_cast<std::size_t>(frame)]);
    status.push_back(pose.accepted);
  }
  std::vector<std::string> cautions = CautionsOf(path, file, options, found.poses);
  if (found.read.usedBits > 0)
  {
    cautions.push_back(UsedBitsWarning(file, found.read));
  }
  const bool isMasked = Given<bool>(settings, "AutoMask") || !found.shape.empty();
  const std::vector<unsigned char>& mask = Given<bool>(settings, "AutoMask") ? found.read.lit : found.shape;
  const auto h = static_cast<std::size_t>(file.height), w = static_cast<std::size_t>(file.width);
  nb::dict answer = Dict("pixels",
                         file.elementType == ElementType::UInt8    ? PixelsOf<std::uint8_t>(found.bytes, file, n)
                         : file.elementType == ElementType::UInt16 ? PixelsOf<std::uint16_t>(found.bytes, file, n)
                                                                   : PixelsOf<float>(found.bytes, file, n),
                         "poses", found.poses.chain.empty() ? std::nullopt : std::optional(PosesToArray(matrices)),
                         "timestamps", TimesOf(std::move(times)), "status", Owned(std::move(status)), "source_frames",
                         Owned(std::vector<std::int32_t>(found.frames.begin(), found.frames.end())), "mask",
                         isMasked ? std::optional(Owned(mask, {h, w})) : std::nullopt, "warnings", ToTexts(cautions));
  PutFacts(answer, found);
  return answer;
}

void Write(SequenceToWrite sequence, const std::vector<Eigen::Matrix4d>& poses, const std::string& path)
{
  sequence.imageToReference = RowByRow(poses);
  WorkAlone(nb::none(), [&](PythonProgress& goOn) { return WriteSequence(sequence, path, std::ref(goOn)); });
}

void WriteSweep(const Sweep& sweep, const std::string& path, const std::string& from, const std::string& to,
                bool compression)
{
  SequenceToWrite sequence;
  sequence.width = sweep.width;
  sequence.height = sweep.height;
  sequence.elementType = sweep.pixelType == Sweep::PixelType::UInt8 ? ElementType::UInt8 : ElementType::Float32;
  sequence.pixels = sweep.pixels.get();
  sequence.timestamps = sweep.timestamps;
  sequence.fromFrame = from;
  sequence.toFrame = to;
  sequence.compression = compression;
  Write(std::move(sequence), sweep.imageToReference, path);
}

/// Images [n, height, width] of any values, NaN too, at their planes [n, 4, 4].
void WriteImages(const InputFloats& images, const InputDoubles& planes, std::optional<std::vector<double>> timestamps,
                 const std::string& path)
{
  RequireShape(images, {-1, -1, -1}, "images");
  const auto count = static_cast<std::int64_t>(images.shape(0));
  RequireShape(planes, {count, 4, 4}, "planes");
  SequenceToWrite sequence;
  sequence.height = static_cast<int>(images.shape(1));
  sequence.width = static_cast<int>(images.shape(2));
  sequence.elementType = ElementType::Float32;
  sequence.pixels = images.data();
  sequence.timestamps = std::move(timestamps).value_or(std::vector<double>());
  std::vector<Eigen::Matrix4d> poses;  // with the third column, bit for bit, that 'bigus slice' writes
  for (std::int64_t k = 0; k < count; ++k)
  {
    const Eigen::Matrix4d plane = MatrixAt(planes.data() + 16 * k);
    poses.push_back(SlicePlane::FromImageToReference(plane, sequence.width, sequence.height).ImageToReference());
  }
  Write(std::move(sequence), poses, path);
}

/// Returns what the file does not keep of the field.
std::vector<std::string> WriteStoredField(Field field, const std::string& path, bool isRounded)
{
  const nb::gil_scoped_release others;
  RequireFieldName(path);
  field.field.Validate();
  if (isRounded)
  {
    field = Rounded(std::move(field));
  }
  std::vector<std::string> leftOut;
  if (!KeepsLabels(path) && field.labels)
  {
    field.labels.reset();
    leftOut.emplace_back("the field's labels are");
  }
  WriteField(field, path);
  return leftOut;
}

nb::dict ReadSlicePlanes(const std::string& path, double spacing, bool worldIsLps, const nb::kwargs& settings)
{
  PlaneFile file;
  const PoseOptions options = PoseOptionsOf(settings);
  {
    const nb::gil_scoped_release others;
    ReadPlanes(path, options, spacing, worldIsLps, file);
  }
  const std::size_t n = file.planes.size();
  std::vector<Eigen::Matrix4d> poses;
  std::vector<std::int32_t> sizes, sources;
  std::vector<double> times;
  for (const FilePlane& plane : file.planes)
  {
    poses.push_back(plane.imageToReference);
    sizes.insert(sizes.end(), {plane.width, plane.height});
    sources.push_back(plane.sourceFrame);
    times.push_back(plane.timestamp);
  }
  return Dict("poses", PosesToArray(poses), "sizes", Owned(std::move(sizes), {n, 2}), "source_frames",
              Owned(std::move(sources)), "timestamps", TimesOf(std::move(times)), "rejections",
              ToText(file.rejections));
}

std::pair<double, double> HeaderSpacing(const std::string& path)
{
  ImageOptions images;
  images.plain = true;
  const SequenceFile file = ReadSequenceFile(path, images);
  return {file.spacing[0], file.spacing[1]};
}

}  // namespace

void BindFiles(nb::module_& m)
{
  m.def("read_sequence", &ReadSequence, "path"_a, "settings"_a);
  m.def("header_spacing", &HeaderSpacing, "path"_a);
  m.def("is_sequence", &IsSequence, "path"_a, "plain"_a);
  m.def("write_sweep", &WriteSweep, "sweep"_a, "path"_a, "FromFrame"_a, "ToFrame"_a, "Compression"_a);
  m.def("write_images", &WriteImages, "images"_a, "planes"_a, "timestamps"_a.none(), "path"_a);
  m.def("is_field", &IsField, "path"_a);
  m.def(
      "read_field", [](const std::string& path) { return ReadField(path); }, "path"_a,
      nb::call_guard<nb::gil_scoped_release>(), "Nothing for a .vtp in another encoding than ours.");
  m.def("write_field", &WriteStoredField, "field"_a, "path"_a, "Rounding"_a);
  m.def("read_planes", &ReadSlicePlanes, "path"_a, "spacing"_a, "world_is_lps"_a, "settings"_a);
}

}  // namespace bigus
