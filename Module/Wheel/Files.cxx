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
#include "IO/FieldFile.h"
#include "IO/FrameGeometry.h"
#include "IO/PlaneFile.h"
#include "IO/SequenceFrames.h"
#include "IO/SequenceOutput.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

/// Runs `work` while other threads of Python run. It gets a function that says whether to go on, for Ctrl-C.
template <class Work>
void WorkAlone(const Work& work)
{
  bool isInterrupted = false;
  {
    const nb::gil_scoped_release others;
    work(
        [&isInterrupted](double)
        {
          const nb::gil_scoped_acquire lock;
          isInterrupted = isInterrupted || PyErr_CheckSignals() != 0;
          return !isInterrupted;
        });
  }
  if (isInterrupted)
  {
    throw nb::python_error();
  }
}

PoseOptions PoseOptionsOf(const std::string& config, const std::string& from, const std::string& to,
                          const std::array<double, 2>& spacing, bool assumeOk, bool allowReflected)
{
  PoseOptions options;
  options.imageSpacing = spacing;
  options.configFileName = config;
  options.fromFrame = from;
  options.toFrame = to;
  options.assumeMissingStatusOK = assumeOk;
  options.allowReflectedPoses = allowReflected;
  return options;
}

template <class Pixel>
Array PixelsOf(const std::shared_ptr<unsigned char>& bytes, const SequenceFile& file, std::size_t frames)
{
  auto* kept = new std::shared_ptr<unsigned char>(bytes);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::shared_ptr<unsigned char>*>(p); });
  return View(reinterpret_cast<Pixel*>(kept->get()),
              {frames, static_cast<std::size_t>(file.height), static_cast<std::size_t>(file.width)}, owner);
}

/// A sequence as it is in the file, with what is known of it: see files.py.
nb::dict ReadSequence(const std::string& path, const std::string& config, const std::string& from,
                      const std::string& to, const std::array<double, 2>& spacing, bool assumeOk, bool allowReflected,
                      const std::string& imageFolder, const std::string& imagePattern, double pixelRange, bool autoMask,
                      int clipMode, const std::array<int, 4>& rectangle, const std::array<double, 2>& apex,
                      const std::array<double, 2>& radii, const std::array<double, 2>& angles, bool keepRejected,
                      bool requirePoses)
{
  SequenceFile file;
  PoseTable poses;
  std::vector<int> frames;
  std::shared_ptr<unsigned char> bytes;
  std::vector<unsigned char> shape;
  ReadPixels read;
  WorkAlone(
      [&](const std::function<bool(double)>& goOn)
      {
        ImageOptions images;
        images.folder = imageFolder;
        images.pattern = imagePattern;
        images.plain = !requirePoses;
        file = ReadSequenceFile(path, images);
        PoseOptions options = PoseOptionsOf(config, from, to, spacing, assumeOk, allowReflected);
        options.required = requirePoses;
        ResolvePoses(file, options, poses);
        poses.RequireFrames(path);
        Clip clip;
        clip.shape = clipMode == 1 ? Clip::Shape::Rectangle : clipMode == 2 ? Clip::Shape::Fan : Clip::Shape::None;
        std::copy(rectangle.begin(), rectangle.end(), clip.rectangle);
        std::copy(apex.begin(), apex.end(), clip.apex);
        std::copy(radii.begin(), radii.end(), clip.radii);
        std::copy(angles.begin(), angles.end(), clip.angles);
        shape = ClipMask(file, clip);
        for (std::size_t k = 0; k < poses.frames.size(); ++k)
        {
          if (keepRejected || poses.frames[k].accepted)
          {
            frames.push_back(static_cast<int>(k));
          }
        }
        bytes = AllocatePixels<unsigned char>(static_cast<std::size_t>(file.FrameBytes()) * frames.size());
        ReadFrames(file, poses, frames, shape, std::max(0.0, pixelRange), goOn, bytes.get(), read);
      });

  const std::size_t n = frames.size();
  std::vector<Eigen::Matrix4d> matrices;
  std::vector<double> times;
  std::vector<std::uint8_t> status;
  bool allTimed = true;
  for (const int frame : frames)
  {
    const auto k = static_cast<std::size_t>(frame);
    matrices.push_back(poses.frames[k].imageToReference);
    times.push_back(poses.timestamps[k]);
    status.push_back(poses.frames[k].accepted);
    allTimed = allTimed && std::isfinite(poses.timestamps[k]);
  }
  std::vector<std::string> warnings;
  if (const std::string cropped = poses.CroppedFrame(from); !cropped.empty())
  {
    warnings.push_back(CroppedFrameWarning(path, from, cropped));
  }
  if (poses.NumberOfMadeAxes() > 0)
  {
    warnings.push_back(MadeAxesWarning(path, poses));
  }
  if (!file.timesNote.empty())
  {
    warnings.push_back(file.timesNote);
  }
  const std::string spacingDoubt = SpacingDoubt(file, poses);
  if (!spacingDoubt.empty())
  {
    warnings.push_back(spacingDoubt);
  }
  if (read.usedBits > 0)
  {
    warnings.push_back(UsedBitsWarning(file, read));
  }
  nb::list transforms;
  for (const TransformName& transform : poses.transforms)
  {
    transforms.append(nb::make_tuple(ToText(transform.Name()), transform.source));
  }
  nb::list rejections;
  for (const Rejection& rejection : poses.rejections)
  {
    rejections.append(nb::make_tuple(ToText(rejection.reason), rejection.frames));
  }
  const auto h = static_cast<std::size_t>(file.height), w = static_cast<std::size_t>(file.width);
  nb::dict found;
  found["pixels"] = file.elementType == ElementType::UInt8    ? PixelsOf<std::uint8_t>(bytes, file, n)
                    : file.elementType == ElementType::UInt16 ? PixelsOf<std::uint16_t>(bytes, file, n)
                                                              : PixelsOf<float>(bytes, file, n);
  found["poses"] = poses.chain.empty() ? nb::none() : nb::object(PosesToArray(matrices));
  found["timestamps"] = allTimed ? nb::object(Owned(std::move(times), {n})) : nb::none();
  found["status"] = Owned(std::move(status), {n});
  found["source_frames"] = Owned(std::vector<std::int32_t>(frames.begin(), frames.end()), {n});
  found["mask"] = autoMask         ? nb::object(Owned(std::move(read.lit), {h, w}))
                  : !shape.empty() ? nb::object(Owned(std::move(shape), {h, w}))
                                   : nb::none();
  found["warnings"] = ToTexts(warnings);
  found["frames_in_file"] = poses.frames.size();
  found["accepted_frames"] = poses.NumberOfAcceptedFrames();
  found["rejections"] = rejections;
  found["rejection_summary"] = ToText(poses.RejectionSummary());
  found["transforms"] = transforms;
  found["transform_chain"] = ToText(poses.chain);
  found["format"] = ToText(file.format);
  found["encoding"] = NameOf(file.encoding);
  found["element_type"] = file.PixelType();
  found["orientation"] = ToText(file.orientation);
  found["spacing_doubt"] = ToText(spacingDoubt);
  found["used_pixel_range"] = read.usedRange;
  found["made_axes"] = poses.NumberOfMadeAxes();
  const FrameGeometry geometry = poses.chain.empty() ? FrameGeometry() : MeasureFrames(file, poses.frames);
  const auto& [i, j] = geometry.pixelSize;
  const SweepGeometry& planes = geometry.planes;
  found["frame_size"] = nb::make_tuple(w, h);
  found["pixel_size"] = nb::make_tuple(i, j);
  found["plane_spacing"] = nb::make_tuple(planes.smallestSpacing, planes.usualSpacing, planes.largestSpacing);
  found["path_length"] = geometry.pathLength;
  const auto& b = geometry.bounds;
  found["bounds"] = nb::make_tuple(b[0], b[1], b[2], b[3], b[4], b[5]);
  return found;
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
  for (const Eigen::Matrix4d& pose : sweep.imageToReference)
  {
    for (int k = 0; k < 16; ++k)
    {
      sequence.imageToReference.push_back(pose(k / 4, k % 4));
    }
  }
  WorkAlone([&](const std::function<bool(double)>& goOn) { WriteSequence(sequence, path, goOn); });
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
  for (std::int64_t k = 0; k < count; ++k)
  {
    const Eigen::Matrix4d pose =
        SlicePlane::FromImageToReference(MatrixAt(planes.data() + 16 * k), sequence.width, sequence.height)
            .ImageToReference();  // with the third column, bit for bit, that 'bigus slice' writes
    for (int e = 0; e < 16; ++e)
    {
      sequence.imageToReference.push_back(pose(e / 4, e % 4));
    }
  }
  WorkAlone([&](const std::function<bool(double)>& goOn) { WriteSequence(sequence, path, goOn); });
}

/// Nothing for a .vtp in another encoding than ours.
std::optional<Field> ReadStoredField(const std::string& path)
{
  const nb::gil_scoped_release others;
  std::optional<StoredField> stored = ReadField(path);
  if (!stored)
  {
    return std::nullopt;
  }
  Field field(std::move(stored->field), std::move(stored->provenance), std::move(stored->standardError));
  field.view = std::move(stored->view);
  field.labels = std::move(stored->labels);
  return field;
}

/// Returns what the file does not keep of the field.
std::vector<std::string> WriteStoredField(Field field, const std::string& path, bool isRounded)
{
  const nb::gil_scoped_release others;
  RequireFieldName(path);
  field.Validate();
  if (isRounded)
  {
    field = Rounded(std::move(field));
  }
  StoredField stored{
      std::move(static_cast<GaussianField&>(field)), std::move(field.provenance), {}, std::move(field.standardError)};
  stored.view = std::move(field.view);
  std::vector<std::string> leftOut;
  if (KeepsLabels(path))
  {
    stored.labels = std::move(field.labels);
  }
  else if (field.labels)
  {
    leftOut.emplace_back("the field's labels are");
  }
  WriteField(stored, path);
  return leftOut;
}

nb::dict ReadSlicePlanes(const std::string& path, double spacing, bool worldIsLps, const std::string& config,
                         const std::string& from, const std::string& to, const std::array<double, 2>& imageSpacing,
                         bool assumeOk, bool allowReflected)
{
  PlaneFile file;
  {
    const nb::gil_scoped_release others;
    ReadPlanes(path, PoseOptionsOf(config, from, to, imageSpacing, assumeOk, allowReflected), spacing, worldIsLps,
               file);
  }
  const std::size_t n = file.planes.size();
  std::vector<Eigen::Matrix4d> poses;
  std::vector<std::int32_t> sizes, sources;
  std::vector<double> times;
  bool allTimed = true;
  for (const FilePlane& plane : file.planes)
  {
    poses.push_back(plane.imageToReference);
    sizes.insert(sizes.end(), {plane.width, plane.height});
    sources.push_back(plane.sourceFrame);
    times.push_back(plane.timestamp);
    allTimed = allTimed && std::isfinite(plane.timestamp);
  }
  nb::dict found;
  found["poses"] = PosesToArray(poses);
  found["sizes"] = Owned(std::move(sizes), {n, 2});
  found["source_frames"] = Owned(std::move(sources), {n});
  found["timestamps"] = allTimed ? nb::object(Owned(std::move(times), {n})) : nb::none();
  found["rejections"] = ToText(file.rejections);
  return found;
}

}  // namespace

void BindFiles(nb::module_& m)
{
  m.def("read_sequence", &ReadSequence, nb::arg("path"), nb::arg("ConfigFileName"), nb::arg("FromFrame"),
        nb::arg("ToFrame"), nb::arg("ImageSpacing"), nb::arg("AssumeMissingStatusOK"), nb::arg("AllowReflectedPoses"),
        nb::arg("ImageFolder"), nb::arg("ImagePattern"), nb::arg("PixelRange"), nb::arg("AutoMask"),
        nb::arg("ClipMode"), nb::arg("ClipRectangle"), nb::arg("FanApex"), nb::arg("FanRadii"), nb::arg("FanAngles"),
        nb::arg("KeepRejectedFrames"), nb::arg("RequirePoses"));
  m.def(
      "header_spacing",
      [](const std::string& path)
      {
        ImageOptions images;
        images.plain = true;
        const SequenceFile file = ReadSequenceFile(path, images);
        return std::make_pair(file.spacing[0], file.spacing[1]);
      },
      nb::arg("path"));
  m.def("is_sequence", &IsSequence, nb::arg("path"), nb::arg("plain"));
  m.def("write_sweep", &WriteSweep, nb::arg("sweep"), nb::arg("path"), nb::arg("FromFrame"), nb::arg("ToFrame"),
        nb::arg("Compression"));
  m.def("write_images", &WriteImages, nb::arg("images"), nb::arg("planes"), nb::arg("timestamps").none(),
        nb::arg("path"));
  m.def("is_field", &IsField, nb::arg("path"));
  m.def("read_field", &ReadStoredField, nb::arg("path"));
  m.def("write_field", &WriteStoredField, nb::arg("field"), nb::arg("path"), nb::arg("Rounding"));
  m.def("read_planes", &ReadSlicePlanes, nb::arg("path"), nb::arg("spacing"), nb::arg("world_is_lps"),
        nb::arg("ConfigFileName"), nb::arg("FromFrame"), nb::arg("ToFrame"), nb::arg("ImageSpacing"),
        nb::arg("AssumeMissingStatusOK"), nb::arg("AllowReflectedPoses"));
}

}  // namespace bigus
