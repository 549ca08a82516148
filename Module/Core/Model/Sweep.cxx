// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Model/Sweep.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <tuple>
#include <type_traits>

#include "Core/Model/Error.h"
#include "Core/Model/PixelMemory.h"

namespace bigus
{
namespace
{

std::size_t BytesPerPixel(Sweep::PixelType type)
{
  return type == Sweep::PixelType::UInt8 ? 1 : sizeof(float);
}

void CheckFrame(const Sweep& sweep, int frame)
{
  Require(frame >= 0 && frame < sweep.NumberOfFrames(), "Sweep: frame ", frame,
          " was asked for, but the frames are 0 to ", sweep.NumberOfFrames() - 1, ".");
}

/// An array of one entry a frame may be left out, but not be of another length.
template <class T>
void CheckLength(const std::vector<T>& array, const char* name, int frames)
{
  Require(array.empty() || array.size() == static_cast<std::size_t>(frames), "Sweep: ", array.size(), " ", name,
          " for ", frames, " frames; give one a frame, or none.");
}

/// Averages the n x n blocks of one frame; `scale` takes a pixel to [0, 1].
template <class Pixel, class Sum>
void ReduceFrame(const Pixel* in, int width, int n, double scale, int outWidth, int outHeight, float* out)
{
  const double mean = scale / (static_cast<double>(n) * n);
  std::vector<Sum> sums(outWidth);
  for (int y = 0; y < outHeight; ++y)
  {
    std::fill(sums.begin(), sums.end(), Sum(0));
    for (int dy = 0; dy < n; ++dy)
    {
      const Pixel* row = in + (static_cast<std::size_t>(y) * n + dy) * width;
      for (int x = 0; x < outWidth; ++x)
      {
        for (int dx = 0; dx < n; ++dx)
        {
          sums[x] += row[static_cast<std::size_t>(x) * n + dx];
        }
      }
    }
    for (int x = 0; x < outWidth; ++x)
    {
      out[static_cast<std::size_t>(y) * outWidth + x] = static_cast<float>(static_cast<double>(sums[x]) * mean);
    }
  }
}

/// Copies every n-th pixel of every n-th row, from `in` on.
template <class Pixel>
void TakeEvery(const Pixel* in, int width, int n, int outWidth, int outHeight, Pixel* out)
{
  for (int y = 0; y < outHeight; ++y)
  {
    const Pixel* row = in + static_cast<std::size_t>(y) * n * width;
    for (int x = 0; x < outWidth; ++x)
    {
      *out++ = row[static_cast<std::size_t>(x) * n];
    }
  }
}

/// The first of every n-th pixel along a side, for phases 0 to n - 1. What is left over at the side's end is taken by odd
/// frames in place of what lies at its beginning.
int FirstOfPhase(int side, int n, int phase, bool isOdd)
{
  return isOdd && phase < side % n ? phase + n : phase;
}

/// Adds those of a frame, where there are any.
void CopyTimeAndSequence(const Sweep& from, int frame, Sweep& to)
{
  if (!from.timestamps.empty())
  {
    to.timestamps.push_back(from.timestamps[frame]);
  }
  if (!from.sequences.empty())
  {
    to.sequences.push_back(from.sequences[frame]);
  }
}

/// Pixels of all sequences, one after the other. What a sequence's own mask leaves out is black.
template <class Pixel>
std::shared_ptr<const void> JoinPixels(const std::vector<std::shared_ptr<const Sweep>>& sequences, std::size_t frames)
{
  const std::size_t size = sequences[0]->PixelsPerFrame();
  const auto joined = AllocatePixels<Pixel>(size * frames);
  Pixel* pixels = joined.get();
  for (const auto& sequence : sequences)
  {
    for (int frame = 0; frame < sequence->NumberOfFrames(); ++frame, pixels += size)
    {
      if constexpr (std::is_same_v<Pixel, std::uint8_t>)
      {
        std::copy_n(static_cast<const std::uint8_t*>(sequence->pixels.get()) + frame * size, size, pixels);
      }
      else
      {
        sequence->CopyFrame(frame, pixels);
      }
      for (std::size_t pixel = 0; sequence->mask && pixel < size; ++pixel)
      {
        pixels[pixel] = sequence->IsLit(pixel) ? pixels[pixel] : Pixel(0);
      }
    }
  }
  return joined;
}

/// Lit where any of the masks is that take(k, mask) gives for k in [0, count).
template <class Take>
std::shared_ptr<const std::vector<std::uint8_t>> LitByAny(std::size_t pixels, int count, Take&& take)
{
  auto any = std::make_shared<std::vector<std::uint8_t>>(pixels, std::uint8_t(0));
  std::vector<std::uint8_t> lit(pixels);
  for (int k = 0; k < count; ++k)
  {
    take(k, lit.data());
    for (std::size_t p = 0; p < pixels; ++p)
    {
      (*any)[p] |= lit[p] != 0;
    }
  }
  return any;
}

}  // namespace

void Sweep::CopyFrame(int frame, float* image) const
{
  CheckFrame(*this, frame);
  const std::size_t n = PixelsPerFrame();
  const std::size_t first = static_cast<std::size_t>(frame) * n;
  if (pixelType == PixelType::Float32)
  {
    std::copy_n(static_cast<const float*>(pixels.get()) + first, n, image);
    return;
  }
  const auto* in = static_cast<const std::uint8_t*>(pixels.get()) + first;
  std::transform(in, in + n, image, [](std::uint8_t p) { return static_cast<float>(p) / 255.0f; });
}

void Sweep::Prefetch(const std::vector<int>& frames) const
{
  const std::size_t bytes = PixelsPerFrame() * BytesPerPixel(pixelType);
  for (const int frame : frames)
  {
    CheckFrame(*this, frame);
    PrefetchPixels(static_cast<const unsigned char*>(pixels.get()) + static_cast<std::size_t>(frame) * bytes, bytes);
  }
}

Sweep Sweep::Reduced(int n) const
{
  return n == 1 ? *this : ReducedOf(AllFrames(*this), n);
}

Sweep Sweep::ReducedOf(const std::vector<int>& frames, int n) const
{
  Require(n >= 1 && n <= width && n <= height, "Sweep: cannot average blocks of ", n, " x ", n, " pixels in frames of ",
          width, " x ", height, "; the block's side must be at least 1 and fit the frame.");
  if (n == 1)
  {
    return Subset(frames);
  }
  Sweep out;
  out.width = width / n;
  out.height = height / n;
  out.pixelType = PixelType::Float32;
  out.averaged = averaged * n;

  // Old index = n * new index + (n - 1) / 2: the centre of a block.
  Eigen::Matrix4d newToOld = Eigen::Matrix4d::Identity();
  newToOld(0, 0) = newToOld(1, 1) = n;
  newToOld(0, 3) = newToOld(1, 3) = 0.5 * (n - 1);
  for (const int frame : frames)
  {
    CheckFrame(*this, frame);
    out.imageToReference.push_back(imageToReference[frame] * newToOld);
    CopyTimeAndSequence(*this, frame, out);
  }

  const std::size_t outPixels = out.PixelsPerFrame();
  const auto reduced = AllocatePixels<float>(outPixels * frames.size());
  tbb::parallel_for(std::size_t(0), frames.size(),
                    [&](std::size_t k)
                    {
                      const std::size_t first = static_cast<std::size_t>(frames[k]) * PixelsPerFrame();
                      float* to = reduced.get() + k * outPixels;
                      if (pixelType == PixelType::UInt8)
                      {
                        const auto* from = static_cast<const std::uint8_t*>(pixels.get()) + first;
                        ReduceFrame<std::uint8_t, std::uint64_t>(from, width, n, 1.0 / 255.0, out.width, out.height,
                                                                 to);
                      }
                      else
                      {
                        const auto* from = static_cast<const float*>(pixels.get()) + first;
                        ReduceFrame<float, double>(from, width, n, 1.0, out.width, out.height, to);
                      }
                    });
  out.pixels = reduced;

  if (mask)
  {
    out.mask = LitByAny(outPixels, n * n,
                        [&](int k, std::uint8_t* lit)
                        { TakeEvery(mask->data() + k / n * width + k % n, width, n, out.width, out.height, lit); });
  }
  return out;
}

Sweep Sweep::Interleaved(const std::vector<int>& frames, int n) const
{
  Require(n >= 1 && n <= width && n <= height, "Sweep: cannot take pixels that lie ", n, " apart from frames of ",
          width, " x ", height, "; the step must be at least 1 and fit the frame.");
  Sweep out;
  out.width = width / n;
  out.height = height / n;
  out.pixelType = pixelType;
  const int phases = n * n, all = static_cast<int>(frames.size()) * phases;
  const auto first = [&](int k)
  {
    const bool isOdd = k / phases % 2 == 1;
    return std::pair(FirstOfPhase(width, n, k % n, isOdd), FirstOfPhase(height, n, k % phases / n, isOdd));
  };
  for (int k = 0; k < all; ++k)
  {
    const int frame = frames[k / phases];
    CheckFrame(*this, frame);
    Eigen::Matrix4d newToOld = Eigen::Matrix4d::Identity();
    newToOld(0, 0) = newToOld(1, 1) = n;
    std::tie(newToOld(0, 3), newToOld(1, 3)) = first(k);
    out.imageToReference.push_back(imageToReference[frame] * newToOld);
    CopyTimeAndSequence(*this, frame, out);
  }

  const std::size_t outPixels = out.PixelsPerFrame(), size = BytesPerPixel(pixelType);
  const auto offset = [&](int k)
  { return static_cast<std::size_t>(first(k).second) * width + static_cast<std::size_t>(first(k).first); };
  const auto taken = AllocatePixels<unsigned char>(outPixels * size * all);
  tbb::parallel_for(0, all,
                    [&](int k)
                    {
                      const std::size_t in = frames[k / phases] * PixelsPerFrame() + offset(k);
                      const auto* from = static_cast<const unsigned char*>(pixels.get()) + in * size;
                      unsigned char* to = taken.get() + k * outPixels * size;
                      if (pixelType == PixelType::UInt8)
                      {
                        TakeEvery(from, width, n, out.width, out.height, to);
                      }
                      else
                      {
                        TakeEvery(reinterpret_cast<const float*>(from), width, n, out.width, out.height,
                                  reinterpret_cast<float*>(to));
                      }
                    });
  out.pixels = taken;

  if (mask)
  {
    const int evenAndOdd = std::min(all, 2 * phases);
    out.mask = LitByAny(outPixels, evenAndOdd,
                        [&](int k, std::uint8_t* lit)
                        { TakeEvery(mask->data() + offset(k), width, n, out.width, out.height, lit); });
  }
  return out;
}

Sweep Sweep::Subset(const std::vector<int>& frames) const
{
  Sweep out;
  out.width = width;
  out.height = height;
  out.pixelType = pixelType;
  out.averaged = averaged;
  out.mask = mask;
  const std::size_t frameBytes = PixelsPerFrame() * BytesPerPixel(pixelType);
  const auto bytes = AllocatePixels<unsigned char>(frameBytes * frames.size());
  for (std::size_t k = 0; k < frames.size(); ++k)
  {
    CheckFrame(*this, frames[k]);
    const std::size_t frame = static_cast<std::size_t>(frames[k]);
    std::memcpy(bytes.get() + k * frameBytes, static_cast<const unsigned char*>(pixels.get()) + frame * frameBytes,
                frameBytes);
    out.imageToReference.push_back(imageToReference[frame]);
    CopyTimeAndSequence(*this, frames[k], out);
  }
  out.pixels = bytes;
  return out;
}

Sweep Sweep::Range(int first, int count) const
{
  CheckFrame(*this, first);
  CheckFrame(*this, first + count - 1);
  const auto cut = [first, count](auto& perFrame)
  {
    if (!perFrame.empty())
    {
      perFrame =
          std::remove_reference_t<decltype(perFrame)>(perFrame.begin() + first, perFrame.begin() + first + count);
    }
  };
  Sweep out = *this;
  cut(out.imageToReference);
  cut(out.timestamps);
  cut(out.sequences);
  const std::size_t skipped = static_cast<std::size_t>(first) * PixelsPerFrame() * BytesPerPixel(pixelType);
  out.pixels = std::shared_ptr<const void>(pixels, static_cast<const unsigned char*>(pixels.get()) + skipped);
  return out;
}

Sweep Sweep::LitBy(const std::vector<int>& frames) const
{
  cv::Mat bright = cv::Mat::zeros(height, width, CV_8U);
  std::vector<float> image(PixelsPerFrame());
  for (int frame : frames)
  {
    CheckFrame(*this, frame);
    CopyFrame(frame, image.data());
    for (std::size_t pixel = 0; pixel < image.size(); ++pixel)
    {
      bright.data[pixel] |= image[pixel] > 0;
    }
  }
  cv::Mat seen = cv::Mat::zeros(height, width, CV_8U);
  for (std::size_t pixel = 0; pixel < image.size(); ++pixel)
  {
    seen.data[pixel] = bright.data[pixel] && IsLit(pixel);
  }
  std::vector<cv::Point> points, hull;
  cv::findNonZero(seen, points);
  cv::Mat inHull = cv::Mat::zeros(height, width, CV_8U);
  if (!points.empty())
  {
    cv::convexHull(points, hull);
    cv::fillConvexPoly(inHull, hull, cv::Scalar(1));
  }
  auto lit = std::make_shared<std::vector<std::uint8_t>>(PixelsPerFrame());
  for (int i = 0; i < width; ++i)
  {
    bool reached = false;
    for (int j = 0; j < height; ++j)
    {
      const std::size_t pixel = static_cast<std::size_t>(j) * width + i;
      reached = reached || seen.data[pixel] != 0;
      // A mask of what is 0 in every frame marks shadows, too; what it hides of brighter pixels stays hidden.
      (*lit)[pixel] = reached && inHull.data[pixel] != 0 && (IsLit(pixel) || bright.data[pixel] == 0);
    }
  }
  Sweep out = *this;
  out.mask.reset();
  if (std::count(lit->begin(), lit->end(), 0) > 0)
  {
    out.mask = lit;
  }
  return out;
}

void Sweep::BlackenUnlit(float* image) const
{
  for (std::size_t pixel = 0; mask && pixel < mask->size(); ++pixel)
  {
    if (!IsLit(pixel))
    {
      image[pixel] = 0;
    }
  }
}

void Sweep::ValidateLayout() const
{
  const int frames = NumberOfFrames();
  Require(frames != 0, "Sweep: there is no frame; at least one tracked frame is needed.");
  Require(width >= 1 && height >= 1, "Sweep: frames are ", width, " x ", height,
          " pixels; both sides must be at least 1.");
  Require(PixelsPerFrame() <= std::numeric_limits<std::ptrdiff_t>::max() / sizeof(float) / frames, "Sweep: ", frames,
          " frames of ", width, " x ", height, " pixels are more than this machine can address.");
  Require(pixels != nullptr, "Sweep: the frames have poses but no pixels.");
  CheckLength(timestamps, "timestamps", frames);
  CheckLength(sequences, "numbers of sequences", frames);
  Require(std::is_sorted(sequences.begin(), sequences.end()),
          "Sweep: frames of one sequence must follow each other, but their numbers of sequences fall.");
  if (mask && mask->size() != PixelsPerFrame())
  {
    throw Error("Sweep: the mask has " + std::to_string(mask->size()) + " pixels, but frames are " +
                std::to_string(width) + " x " + std::to_string(height) + " pixels.");
  }
  for (int frame = 0; frame < frames; ++frame)
  {
    const std::string what = "frame " + std::to_string(frame);
    const Eigen::Matrix4d& pose = imageToReference[frame];
    Require(pose.allFinite(), what, ": the pose holds a value that is not finite; check the tracker's transforms.");
    Require((pose.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() <= 1e-6, what,
            ": the pose's last row is not 0 0 0 1, so it is not an affine transform to mm; is the "
            "matrix stored column by column?");
    Plane(frame).Validate(what);
    Require(Plane(frame).IsWithinReach(), what, ": it lies farther than 1e9 mm from the origin; is the pose in mm?");
    Require(timestamps.empty() || std::isfinite(timestamps[frame]), what, ": the timestamp is not finite.");
  }
}

void Sweep::Validate() const
{
  ValidateLayout();
  if (pixelType == PixelType::UInt8)
  {
    return;  // every value is in range
  }
  const auto* values = static_cast<const float*>(pixels.get());
  const std::size_t n = PixelsPerFrame() * NumberOfFrames();
  std::atomic<std::size_t> firstBad(n);  // the lowest index, whatever the order of the threads
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 1 << 16),
                    [&](const tbb::blocked_range<std::size_t>& range)
                    {
                      const float* end = values + range.end();
                      const float* bad =
                          std::find_if(values + range.begin(), end, [](float v) { return !(v >= 0.0f && v <= 1.0f); });
                      if (bad != end)
                      {
                        const std::size_t index = bad - values;
                        std::size_t known = firstBad;
                        while (index < known && !firstBad.compare_exchange_weak(known, index))
                        {
                        }
                      }
                    });
  if (firstBad < n)
  {
    const std::size_t inFrame = firstBad % PixelsPerFrame();
    const float value = values[firstBad];
    throw Error("frame " + std::to_string(firstBad / PixelsPerFrame()) + ": pixel (" + std::to_string(inFrame % width) +
                ", " + std::to_string(inFrame / width) + ") is " + std::to_string(value) +
                "; float pixels must lie in [0, 1]. " +
                (!std::isfinite(value) ? "Give pixels without a value the value 0."
                 : value < 0           ? "Shift and scale them so that black is 0 and white is 1."
                                       : "Divide by the largest value of the original type."));
  }
}

std::pair<std::vector<int>, std::vector<int>> SplitHoldOut(int numberOfFrames, int k)
{
  Require(k >= 0 && k != 1, "Hold-out: K is ", k,
          "; it must be 0 (keep every frame for training) or at least 2 (hold out one frame in K).");
  std::pair<std::vector<int>, std::vector<int>> split;
  for (int frame = 0; frame < numberOfFrames; ++frame)
  {
    const bool held = k >= 2 && frame % k == k / 2;
    (held ? split.second : split.first).push_back(frame);
  }
  return split;
}

std::pair<std::vector<int>, std::vector<int>> SplitHoldOut(const Sweep& sweep, const std::vector<int>& frames, int k)
{
  std::pair<std::vector<int>, std::vector<int>> split;
  for (const std::vector<int>& own : BySequence(sweep, frames))
  {
    const auto places = SplitHoldOut(static_cast<int>(own.size()), k);
    const auto pick = [&own](const std::vector<int>& from, std::vector<int>& to)
    { std::transform(from.begin(), from.end(), std::back_inserter(to), [&own](int place) { return own[place]; }); };
    pick(places.first, split.first);
    pick(places.second, split.second);
  }
  return split;
}

std::optional<float> LevelOf(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<float> image(sweep.PixelsPerFrame());
  std::optional<float> level;
  for (const int frame : frames)
  {
    sweep.CopyFrame(frame, image.data());
    for (std::size_t p = 0; p < image.size(); ++p)
    {
      if (sweep.IsLit(p) && image[p] != level.value_or(image[p]))
      {
        return std::nullopt;
      }
      level = sweep.IsLit(p) ? image[p] : level;
    }
  }
  return level.value_or(0);
}

std::vector<int> AllFrames(const Sweep& sweep)
{
  std::vector<int> frames(sweep.NumberOfFrames());
  std::iota(frames.begin(), frames.end(), 0);
  return frames;
}

std::vector<std::vector<int>> BySequence(const Sweep& sweep, const std::vector<int>& frames)
{
  std::vector<std::vector<int>> lists;
  for (const int frame : frames)
  {
    if (lists.empty() || sweep.SequenceOf(frame) != sweep.SequenceOf(lists.back().back()))
    {
      lists.emplace_back();
    }
    lists.back().push_back(frame);
  }
  return lists;
}

std::vector<int> LongestSequence(const Sweep& sweep, const std::vector<int>& frames)
{
  const auto lists = BySequence(sweep, frames);
  const auto longest =
      std::max_element(lists.begin(), lists.end(),
                       [](const std::vector<int>& a, const std::vector<int>& b) { return a.size() < b.size(); });
  return longest == lists.end() ? std::vector<int>() : *longest;
}

void RequireOneSize(int width, int height, const std::string& name, int otherWidth, int otherHeight,
                    const std::string& otherName)
{
  Require(otherWidth == width && otherHeight == height, "Frames of ", name, " are ", width, " x ", height,
          " pixels, those of ", otherName, " ", otherWidth, " x ", otherHeight,
          "; sequences that are trained together need frames of one size. Crop or pad them to it. (Their pixels "
          "may differ in mm.)");
}

std::shared_ptr<const Sweep> Join(const std::vector<std::shared_ptr<const Sweep>>& sequences)
{
  Require(!sequences.empty(), "Sweep: there is no sequence to train on; give at least one.");
  if (sequences.size() == 1)
  {
    return sequences[0];
  }
  Sweep out;
  out.width = sequences[0]->width;
  out.height = sequences[0]->height;
  bool areTimed = true;
  for (std::size_t k = 0; k < sequences.size(); ++k)
  {
    const Sweep& sequence = *sequences[k];
    RequireOneSize(out.width, out.height, "sequence 1", sequence.width, sequence.height,
                   "sequence " + std::to_string(k + 1));
    if (sequence.pixelType != Sweep::PixelType::UInt8)
    {
      out.pixelType = Sweep::PixelType::Float32;
    }
    out.averaged = std::max(out.averaged, sequence.averaged);
    areTimed = areTimed && !sequence.timestamps.empty();
    out.imageToReference.insert(out.imageToReference.end(), sequence.imageToReference.begin(),
                                sequence.imageToReference.end());
    out.timestamps.insert(out.timestamps.end(), sequence.timestamps.begin(), sequence.timestamps.end());
    out.sequences.insert(out.sequences.end(), sequence.imageToReference.size(), static_cast<int>(k));
  }
  if (!areTimed)
  {
    out.timestamps.clear();
  }
  const std::size_t frames = out.imageToReference.size();
  out.pixels = out.pixelType == Sweep::PixelType::UInt8 ? JoinPixels<std::uint8_t>(sequences, frames)
                                                        : JoinPixels<float>(sequences, frames);
  out.mask = LitByAny(out.PixelsPerFrame(), static_cast<int>(sequences.size()),
                      [&](int k, std::uint8_t* lit)
                      {
                        for (std::size_t pixel = 0; pixel < out.PixelsPerFrame(); ++pixel)
                        {
                          lit[pixel] = sequences[k]->IsLit(pixel);
                        }
                      });
  if (std::count(out.mask->begin(), out.mask->end(), 0) == 0)
  {
    out.mask = nullptr;
  }
  return std::make_shared<const Sweep>(std::move(out));
}

}  // namespace bigus
