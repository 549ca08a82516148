// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Scatterers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "Core/Numerics/Constants.h"
#include "Core/Numerics/Random.h"
#include "Core/Phantom/World.h"

namespace bigus
{
namespace
{

/// A box in the aperture's frame that holds every scatterer which can reach the image, and a finer test.
class Slab
{
public:
  Slab(const PhantomOptions& options, const Aperture& aperture)
      : aperture_(aperture),
        sideways_(kReach * options.lateralSigma),
        along_(kReach * options.axialSigma),
        thickness_(kReach * options.elevationSigma)
  {
    const Aperture& p = aperture;
    if (!p.fan)
    {
      low_ = {-p.lastLine - sideways_, p.firstRange - along_, -thickness_};
      high_ = {p.lastLine + sideways_, p.lastRange + along_, thickness_};
      return;
    }
    const double angle = -p.gridLine, outer = p.lastRange + along_;
    const double right = outer * std::sin(std::min(angle, kPi / 2));
    const double top = std::cos(angle) * (angle > kPi / 2 ? outer : std::max(p.firstRange - along_, 0.0));
    low_ = {-right, top - p.apex, -thickness_};
    high_ = {right, outer - p.apex, thickness_};
  }

  const Eigen::Vector3d& Low() const { return low_; }
  const Eigen::Vector3d& High() const { return high_; }
  double Thickness() const { return thickness_; }

  /// Whether a ball of this radius about a point of the plane may reach something lit. Never wrongly false.
  bool Reaches(const BeamPoint& p, double radius) const
  {
    if (p.range < aperture_.firstRange - along_ - radius || p.range > aperture_.lastRange + along_ + radius)
    {
      return false;
    }
    const double beyond = std::abs(p.line) - aperture_.lastLine;
    return aperture_.fan ? beyond * p.range <= sideways_ + kPi / 2 * radius : beyond <= sideways_ + radius;
  }

private:
  const Aperture& aperture_;
  double sideways_, along_, thickness_;  // mm
  Eigen::Vector3d low_, high_;
};

/// Calls visit(index) for every cell (a cube of edge `cell` at integer multiples of it) that meets the slab.
template <class Visit>
void ForEachCell(const Aperture& aperture, const Slab& slab, double cell, Visit&& visit)
{
  Eigen::Matrix3d axes;  // columns: the aperture's frame
  axes << aperture.lateral, aperture.axial, aperture.elevation;
  const double radius = 0.5 * std::sqrt(3.0) * cell;

  Eigen::Vector3d low = aperture.face, high = aperture.face;
  for (int k = 0; k < 3; ++k)
  {
    const Eigen::Vector3d s = axes.col(k) * slab.Low()[k], t = axes.col(k) * slab.High()[k];
    low += s.cwiseMin(t);
    high += s.cwiseMax(t);
  }
  int d = 0;  // the world axis closest to the plane's normal: one interval of cells for each pair of the others
  aperture.elevation.cwiseAbs().maxCoeff(&d);
  const int a = (d + 1) % 3, b = (d + 2) % 3;
  const auto first = [&](int k) { return static_cast<std::int64_t>(std::floor(low[k] / cell)); };
  const auto last = [&](int k) { return static_cast<std::int64_t>(std::floor(high[k] / cell)); };
  const Eigen::Vector3d& n = aperture.elevation;

  std::array<std::int64_t, 3> index;
  for (index[b] = first(b); index[b] <= last(b); ++index[b])
  {
    for (index[a] = first(a); index[a] <= last(a); ++index[a])
    {
      const double ca = (index[a] + 0.5) * cell - aperture.face[a], cb = (index[b] + 0.5) * cell - aperture.face[b];
      const double middle = aperture.face[d] - (n[a] * ca + n[b] * cb) / n[d];
      const double half = (slab.Thickness() + radius) / std::abs(n[d]);
      const std::int64_t from = std::max(first(d), static_cast<std::int64_t>(std::floor((middle - half) / cell)));
      const std::int64_t to = std::min(last(d), static_cast<std::int64_t>(std::floor((middle + half) / cell)));
      for (index[d] = from; index[d] <= to; ++index[d])
      {
        const Eigen::Vector3d centre =
            Eigen::Vector3d(index[0] + 0.5, index[1] + 0.5, index[2] + 0.5) * cell - aperture.face;
        if (slab.Reaches(aperture.ToBeam(aperture.lateral.dot(centre), aperture.axial.dot(centre)), radius))
        {
          visit(index);
        }
      }
    }
  }
}

/// Amplitude of the scatterer that 32 random bits may have put at a point, 0 when there is none; parenchyma's are 1.
/// `share` is the probability of one in parenchyma. Equal amplitudes, a fixed number to a cell, bring the sum closest
/// to fully developed speckle for a given density.
double AmplitudeAt(const PhantomOptions& options, const Eigen::Vector3d& point, double share, std::uint32_t chance)
{
  const bool organ = options.scene == PhantomScene::Organ;
  const Tissue kind = organ ? OrganAt(point) : Tissue::Parenchyma;
  const TissueProperties& tissue = PropertiesOf(kind);
  if (OpenUniform(chance) >= share * tissue.density)
  {
    return 0;
  }
  return tissue.amplitude * (organ && kind == Tissue::Parenchyma ? ParenchymaTexture(point) : 1);
}

/// Visits what lies in the slab, with amplitude() where it does and is not 0.
class Visitor
{
public:
  Visitor(const PhantomOptions& options, const Aperture& aperture, const std::function<void(const Scatterer&)>& visit)
      : slab(options, aperture), aperture_(aperture), visit_(visit)
  {
  }

  template <class Amplitude>
  void Offer(const Eigen::Vector3d& point, Amplitude&& amplitude) const
  {
    const Eigen::Vector3d offset = point - aperture_.face;
    const double z = aperture_.elevation.dot(offset);
    if (std::abs(z) > slab.Thickness())
    {
      return;
    }
    const BeamPoint place = aperture_.ToBeam(aperture_.lateral.dot(offset), aperture_.axial.dot(offset));
    if (!slab.Reaches(place, 0))
    {
      return;
    }
    const double value = amplitude();
    if (value != 0)
    {
      visit_(Scatterer{place, z, value});
    }
  }

  const Slab slab;

private:
  const Aperture& aperture_;
  const std::function<void(const Scatterer&)>& visit_;
};

void ForEachPoint(const Aperture& aperture, const Visitor& visitor)
{
  constexpr double kPitch = 10;           // mm
  constexpr double kPointAmplitude = 10;  // +20 dB
  ForEachCell(aperture, visitor.slab, kPitch / 2,
              [&](const std::array<std::int64_t, 3>& c)
              {
                // Cells of half the pitch: the point is the low corner of every cell with even, odd, even index.
                if (c[0] % 2 == 0 && c[1] % 2 != 0 && c[2] % 2 == 0)
                {
                  visitor.Offer(Eigen::Vector3d(c[0], c[1], c[2]) * (kPitch / 2), [] { return kPointAmplitude; });
                }
              });
}

}  // namespace

void ForEachScatterer(const PhantomOptions& options, const Aperture& aperture,
                      const std::function<void(const Scatterer&)>& visit)
{
  const Visitor visitor(options, aperture, visit);
  if (options.scene == PhantomScene::Points)
  {
    ForEachPoint(aperture, visitor);
    return;
  }
  constexpr double kCell = 0.5;  // mm
  const double expected = options.scattererDensity * kCell * kCell * kCell;
  const int perCell = static_cast<int>(std::ceil(expected));
  // In the sum's unit parenchyma's root mean square is 1: n <a^2> times the integral of the squared profile.
  const double unit = 1 / std::sqrt(options.scattererDensity * std::pow(kPi, 1.5) * options.axialSigma *
                                    options.lateralSigma * options.elevationSigma);
  const std::uint64_t world = Mix(options.seed);
  ForEachCell(aperture, visitor.slab, kCell,
              [&](const std::array<std::int64_t, 3>& c)
              {
                std::uint64_t hash = world;
                for (int k = 0; k < 3; ++k)
                {
                  hash = Mix(hash ^ static_cast<std::uint64_t>(c[k]));
                }
                for (int k = 0; k < perCell; ++k)
                {
                  const std::uint64_t place = Mix(hash + 2 * k);
                  const auto inside = [&](int shift) { return ((place >> shift & 0x1fffff) + 0.5) / 2097152.0; };
                  const Eigen::Vector3d point =
                      Eigen::Vector3d(c[0] + inside(0), c[1] + inside(21), c[2] + inside(42)) * kCell;
                  const std::uint32_t chance = static_cast<std::uint32_t>(Mix(hash + 2 * k + 1));
                  visitor.Offer(point, [&] { return unit * AmplitudeAt(options, point, expected / perCell, chance); });
                }
              });
}

}  // namespace bigus
