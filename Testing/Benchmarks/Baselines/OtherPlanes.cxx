// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "OtherPlanes.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "Core/Evaluation/Baselines.h"
#include "Core/Model/Error.h"
#include "Core/Numerics/Constants.h"

using bigus::Error;
using bigus::KnownPlane;
using bigus::SlicePlane;
using bigus::Sweep;
using Eigen::Vector3d;
using Json = nlohmann::json;

namespace
{

constexpr int kPlanes = 40;                  // of a set, when the job does not say: every fourth of 160 voxels
constexpr double kLeastScoredShare = 0.25;   // of a turned frame; one that is hardly crossed says little
constexpr double kCentralShare = 0.6;        // of a volume's side, over which centres of oblique planes are spread
constexpr double kSmallestDeviation = 1e-6;  // mm, of a stack's frames from their even grid

/// A volume: frames above one another, pixel for pixel, at one spacing. Steps from voxel to voxel are in mm.
struct Stack
{
  Vector3d origin, x, y, z;
  int columns, rows, layers;

  explicit Stack(const Sweep& sweep) : columns(sweep.width), rows(sweep.height), layers(sweep.NumberOfFrames())
  {
    const SlicePlane first = sweep.Plane(0), last = sweep.Plane(layers - 1);
    origin = first.origin;
    x = first.columnStep;
    y = first.rowStep;
    z = (last.origin - first.origin) / std::max(1, layers - 1);
    bool even = layers > 1 && std::abs(z.normalized().dot(first.Normal())) > 1 - kSmallestDeviation;
    for (int k = 0; k < layers; ++k)
    {
      const SlicePlane plane = sweep.Plane(k);
      for (const auto& [i, j] : {std::pair(0, 0), std::pair(columns, 0), std::pair(0, rows)})
      {
        even = even && (plane.Point(i, j) - (origin + i * x + j * y + k * z)).norm() < kSmallestDeviation;
      }
    }
    if (!even)
    {
      throw Error("score: planes of a volume need frames that lie above one another at one spacing.");
    }
  }

  Vector3d Voxel(double i, double j, double k) const { return origin + i * x + j * y + k * z; }
  Vector3d Centre() const { return Voxel(0.5 * (columns - 1), 0.5 * (rows - 1), 0.5 * (layers - 1)); }
};

/// The middle of part k of n equal parts of 0 ... 1.
double Middle(int k, int n)
{
  return (k + 0.5) / n;
}

/// Planes at right angles to `x`, along `y`, whose pixels are voxels.
std::vector<SlicePlane> AcrossX(const Stack& stack, int count)
{
  std::vector<SlicePlane> planes;
  count = std::min(count, stack.columns);
  for (int k = 0; k < count; ++k)
  {
    const int i = static_cast<int>(Middle(k, count) * stack.columns);
    planes.push_back({stack.Voxel(i, 0, 0), stack.y, stack.z, stack.rows, stack.layers});
  }
  return planes;
}

std::vector<SlicePlane> AcrossY(const Stack& stack, int count)
{
  std::vector<SlicePlane> planes;
  count = std::min(count, stack.rows);
  for (int k = 0; k < count; ++k)
  {
    const int j = static_cast<int>(Middle(k, count) * stack.rows);
    planes.push_back({stack.Voxel(0, j, 0), stack.x, stack.z, stack.columns, stack.layers});
  }
  return planes;
}

/// The frames' plane turned about its rows' direction `axis`, so that its columns climb from `side` towards z.
std::vector<SlicePlane> Turned(const Stack& stack, const Vector3d& axis, const Vector3d& side, int width, int sideSteps,
                               double degrees, int count)
{
  const double angle = degrees * bigus::kRadiansPerDegree;
  const double step = side.norm();
  const Vector3d u = side.normalized(), w = stack.z.normalized();
  const Vector3d climb = std::cos(angle) * u + std::sin(angle) * w;
  const Vector3d normal = std::cos(angle) * w - std::sin(angle) * u;
  const double depth = (stack.layers - 1) * stack.z.norm(), across = (sideSteps - 1) * step;
  const int height = static_cast<int>(std::ceil(std::hypot(depth, across) / step));  // no chord is longer
  std::vector<SlicePlane> planes;
  for (int k = 0; k < count; ++k)
  {
    const double offset = kCentralShare * (Middle(k, count) - 0.5) * std::min(depth, across);
    const Vector3d centre = stack.Centre() + offset * normal;
    planes.push_back(
        {centre - 0.5 * (width - 1) * axis - 0.5 * (height - 1) * step * climb, axis, step * climb, width, height});
  }
  return planes;
}

std::vector<SlicePlane> PlanesOfVolume(const std::string& name, const Stack& stack, int count)
{
  if (name == "planes_x")
  {
    return AcrossX(stack, count);
  }
  if (name == "planes_y")
  {
    return AcrossY(stack, count);
  }
  const double degrees = *NumberAfter(name, "planes_");
  std::vector<SlicePlane> planes =
      Turned(stack, stack.x, stack.y, stack.columns, stack.rows, degrees, std::max(1, count / 2));
  const std::vector<SlicePlane> more =
      Turned(stack, stack.y, stack.x, stack.rows, stack.columns, degrees, std::max(1, count - count / 2));
  planes.insert(planes.end(), more.begin(), more.end());
  return planes;
}

std::vector<KnownPlane> CutVolume(const std::string& name, const Sweep& sweep, const std::vector<int>& training,
                                  int count)
{
  const Stack stack(sweep);
  std::vector<int> all(sweep.NumberOfFrames());
  std::iota(all.begin(), all.end(), 0);
  std::vector<KnownPlane> cut;
  for (const SlicePlane& plane : PlanesOfVolume(name, stack, count))
  {
    KnownPlane known{plane, std::vector<float>(plane.NumberOfPixels()),
                     std::vector<std::uint8_t>(plane.NumberOfPixels())};
    // Keys' cubic in all directions; at a voxel it is the voxel.
    PredictCubicInterpolation(sweep, all, plane, known.truth.data());
    FindEnclosed(sweep, training, plane, known.scored.data());
    cut.push_back(std::move(known));
  }
  return cut;
}

/// Frames of the same world, swept in a direction turned by so many degrees.
std::vector<KnownPlane> TurnedSweep(double degrees, const Json& scene, const SceneFolders& folders, const Sweep& sweep,
                                    const std::vector<int>& training, int count)
{
  const std::shared_ptr<const Sweep> turned = MakeTurnedScene(degrees, scene, folders);
  std::vector<KnownPlane> seen;
  for (int frame = 0; frame < turned->NumberOfFrames(); ++frame)
  {
    KnownPlane known{turned->Plane(frame), std::vector<float>(turned->PixelsPerFrame()),
                     std::vector<std::uint8_t>(turned->PixelsPerFrame())};
    turned->CopyFrame(frame, known.truth.data());
    FindEnclosed(sweep, training, known.plane, known.scored.data());
    std::size_t scored = 0;
    for (std::size_t p = 0; p < known.scored.size(); ++p)
    {
      known.scored[p] = known.scored[p] && turned->IsLit(p);
      scored += known.scored[p];
    }
    if (static_cast<double>(scored) >= kLeastScoredShare * static_cast<double>(known.scored.size()))
    {
      seen.push_back(std::move(known));
    }
  }
  const int size = static_cast<int>(seen.size());
  if (size == 0)
  {
    throw Error("score: the training frames enclose no quarter of any turned frame.");
  }
  const int kept = std::min(count, size);
  std::vector<KnownPlane> some;
  for (int k = 0; k < kept; ++k)
  {
    some.push_back(std::move(seen[static_cast<int>(Middle(k, kept) * size)]));
  }
  return some;
}

}  // namespace

std::optional<double> NumberAfter(const std::string& name, const std::string& prefix)
{
  if (name.rfind(prefix, 0) != 0 || name.size() == prefix.size() ||
      name.find_first_not_of("0123456789.", prefix.size()) != std::string::npos)
  {
    return std::nullopt;
  }
  return std::stod(name.substr(prefix.size()));
}

std::shared_ptr<const Sweep> MakeTurnedScene(double degrees, Json scene, const SceneFolders& folders)
{
  if (!scene.contains("phantoms") || scene["phantoms"].size() != 1)
  {
    throw Error("score: turned frames need the sweep of one phantom, whose world is known from any side.");
  }
  Json& phantom = scene["phantoms"][0];
  phantom = WithoutTracker(phantom);  // the truth is where the probe was
  phantom["sweep_angle"] = phantom.value("sweep_angle", 0.0) + degrees;
  return MakeScene(scene, folders);
}

bool IsSetOfOtherPlanes(const std::string& name)
{
  return name == "planes_x" || name == "planes_y" || NumberAfter(name, "planes_") || NumberAfter(name, "turned_");
}

std::vector<KnownPlane> MakeOtherPlanes(const std::string& name, const Json& scene, const SceneFolders& folders,
                                        const Sweep& sweep, const std::vector<int>& training, int count)
{
  const std::optional<double> degrees = NumberAfter(name, "turned_");
  count = count > 0 ? count : kPlanes;
  return degrees ? TurnedSweep(*degrees, scene, folders, sweep, training, count)
                 : CutVolume(name, sweep, training, count);
}
