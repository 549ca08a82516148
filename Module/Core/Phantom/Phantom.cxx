// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/Phantom.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <new>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

constexpr double Pi = 3.14159265358979323846;
constexpr double SpeedOfSound = 1.54;  // mm / us
constexpr double Reach = 4;            // profiles are cut this many standard deviations out (amplitude 3e-4)
constexpr double Oversampling = 3;     // beam grid samples per standard deviation

// ---- random numbers: a counter goes in, 64 well mixed bits come out (splitmix64's finalizer) ----

std::uint64_t Mix(std::uint64_t x)
{
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

/// In (0, 1), from 32 bits.
double Uniform(std::uint32_t bits)
{
  return (bits + 0.5) / 4294967296.0;
}

/// Standard normal number `index` of a stream (Box and Muller).
double Normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t index)
{
  const std::uint64_t bits = Mix(Mix(Mix(seed) + stream) + index);
  const double radius = std::sqrt(-2 * std::log(Uniform(static_cast<std::uint32_t>(bits >> 32))));
  return radius * std::cos(2 * Pi * Uniform(static_cast<std::uint32_t>(bits)));
}

/// A smooth random motion in [-1, 1]: three slow sines (hertz) of random phase.
double Sway(std::uint64_t seed, std::uint64_t stream, double seconds)
{
  constexpr double share[3] = {0.5, 0.3, 0.2};
  constexpr double hertz[3] = {0.21, 0.53, 0.92};
  double sum = 0;
  for (int m = 0; m < 3; ++m)
  {
    const double phase = Uniform(static_cast<std::uint32_t>(Mix(Mix(Mix(seed) + stream) + m)));
    sum += share[m] * std::sin(2 * Pi * (hertz[m] * seconds + phase));
  }
  return sum;
}

enum Stream : std::uint64_t
{
  SpeedStream = 101,
  SwayStream = 111,           // and the four after it
  PositionNoiseStream = 121,  // and the two after it
  RotationNoiseStream = 131   // and the two after it
};

// ---- the world ----

struct TissueProperties
{
  double density;      // scatterers, relative to parenchyma, at most 1
  double amplitude;    // of a scatterer, relative to parenchyma
  double attenuation;  // relative to parenchyma
};

constexpr TissueProperties Properties[] = {
    {1.0, 1.0, 1.0},    // Parenchyma
    {1.0, 0.06, 0.3},   // Vessel: -24 dB
    {0.0, 0.0, 0.0},    // Cyst
    {1.0, 10.0, 20.0},  // Boundary: +20 dB
    {0.3, 0.3, 30.0},   // Bone
    {0.6, 2.8, 0.9},    // Tumour: coarser and brighter, +6.7 dB
};

const TissueProperties& PropertiesOf(Tissue tissue)
{
  return Properties[static_cast<int>(tissue)];
}

/// A tube of constant radius, mm.
struct Tube
{
  double from[3], to[3];
  double radius;
};

constexpr Tube Vessels[] = {
    {{8, 15, -40}, {5, 17, -10}, 3.0},   // trunk,
    {{5, 17, -10}, {2, 19, 6}, 2.8},     // to where it forks
    {{2, 19, 6}, {-3, 23, 40}, 2.2},     // first branch
    {{2, 19, 6}, {13, 16, 17}, 1.9},     // second branch,
    {{13, 16, 17}, {26, 14, 40}, 1.6},   // its end
    {{-40, 44, 8}, {-9, 43, -3}, 1.7},   // a vessel that crosses below,
    {{-9, 43, -3}, {9, 45, -8}, 1.5},    // its middle
    {{9, 45, -8}, {40, 42, 2}, 1.3},     // and end,
    {{-9, 43, -3}, {-4, 48, -30}, 1.2},  // and a twig of it
};
constexpr Tube Rib = {{-19, 15, -60}, {-15, 13, 60}, 4.0};
constexpr double BoundaryThickness = 0.5;  // mm
constexpr double CystCentre[3] = {-4, 33, 3};
constexpr double CystRadii[3] = {6.5, 5.5, 7};
constexpr double TumourCentre[3] = {14, 31, -2};
constexpr double TumourRadii[3] = {7, 6, 8};

double SquaredDistanceToAxis(const Tube& tube, const Eigen::Vector3d& p)
{
  const Eigen::Vector3d from(tube.from), axis = Eigen::Vector3d(tube.to) - from;
  const double along = std::clamp((p - from).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
  return (p - from - along * axis).squaredNorm();
}

/// Squared distance from an ellipsoid's centre, its surface being at 1.
double EllipsoidLevel(const double centre[3], const double radii[3], const Eigen::Vector3d& p)
{
  return ((p - Eigen::Vector3d(centre)).array() / Eigen::Array3d(radii)).square().sum();
}

Tissue OrganAt(const Eigen::Vector3d& p)
{
  const double rib = SquaredDistanceToAxis(Rib, p);
  if (rib < Rib.radius * Rib.radius)
  {
    const double inner = Rib.radius - BoundaryThickness;
    return rib < inner * inner ? Tissue::Bone : Tissue::Boundary;
  }
  if (EllipsoidLevel(CystCentre, CystRadii, p) < 1)
  {
    return Tissue::Cyst;
  }
  const double tumour = EllipsoidLevel(TumourCentre, TumourRadii, p);
  if (tumour < 1.5)
  {
    // Lobes: the surface waves by a tenth of the radius.
    const double lobes = 1 + 0.2 * std::sin(0.9 * p[0]) * std::sin(0.8 * p[1] + 1) * std::sin(0.7 * p[2] + 2);
    if (tumour < lobes)
    {
      return Tissue::Tumour;
    }
  }
  for (const Tube& vessel : Vessels)
  {
    if (SquaredDistanceToAxis(vessel, p) < vessel.radius * vessel.radius)
    {
      return Tissue::Vessel;
    }
  }
  return Tissue::Parenchyma;
}

/// Parenchyma is not uniform: its echoes rise and fall by at most 2 dB over centimetres.
double ParenchymaTexture(const Eigen::Vector3d& p)
{
  return 1 + 0.23 * std::sin(0.33 * p[0] + 0.5) * std::sin(0.29 * p[1]) * std::sin(0.24 * p[2] + 1.1);
}

// ---- the probe, attached to a plane ----

/// Beam coordinates of a plane's point: range along the line and the line itself (mm sideways, or radian in a
/// fan).
struct BeamPoint
{
  double range, line;
};

/// Where a plane's probe stands, what it lights, and the grid of lines and ranges on which echoes are summed.
struct Aperture
{
  Eigen::Vector3d face;                       // middle of the first row, mm
  Eigen::Vector3d lateral, axial, elevation;  // unit
  double pixelWidth, pixelHeight, centreColumn;
  int width, height;

  bool fan;
  double apex;                   // distance of the apex above the first row, mm; 0 for a linear probe
  double firstRange, lastRange;  // lit, mm
  double lastLine;               // lit to both sides, mm or radian

  double lineStep, rangeStep;                                  // of the grid
  double gridLine, gridRange;                                  // first line and range of the grid
  int lines, ranges;                                           // size of the grid
  int firstLitLine, firstLitRange, lastLitLine, lastLitRange;  // grid indices around what is lit

  Aperture(const PhantomOptions& options, const SlicePlane& plane);

  BeamPoint ToBeam(double x, double y) const
  {
    return fan ? BeamPoint{std::sqrt(x * x + (y + apex) * (y + apex)), std::atan2(x, y + apex)} : BeamPoint{y, x};
  }
  double MillimetresPerLine(double range) const { return fan ? range * lineStep : lineStep; }
  bool IsLit(const BeamPoint& p) const
  {
    const double slack = 1e-9;
    return !fan ||
           (p.range >= firstRange - slack && p.range <= lastRange + slack && std::abs(p.line) <= lastLine + slack);
  }
  BeamPoint PixelToBeam(int i, int j) const { return ToBeam((i - centreColumn) * pixelWidth, j * pixelHeight); }

  /// World position of a point of the beam, `z` mm out of the plane.
  Eigen::Vector3d ToWorld(const BeamPoint& p, double z) const
  {
    const double x = fan ? p.range * std::sin(p.line) : p.line;
    const double y = fan ? p.range * std::cos(p.line) - apex : p.range;
    return face + x * lateral + y * axial + z * elevation;
  }
};

Aperture::Aperture(const PhantomOptions& options, const SlicePlane& plane)
{
  plane.Validate("phantom plane");
  const double a = plane.columnStep.norm(), b = plane.rowStep.norm();
  if (std::abs(plane.columnStep.dot(plane.rowStep)) > 1e-4 * a * b)
  {
    throw Error(
        "phantom plane: rows and columns are not orthogonal; beams run along the rows' step, so a sheared "
        "plane has no probe that could see it.");
  }
  axial = plane.rowStep / b;
  elevation = plane.Normal();
  lateral = axial.cross(elevation);
  width = plane.width;
  height = plane.height;
  pixelWidth = a;
  pixelHeight = b;
  centreColumn = 0.5 * (width - 1);
  face = plane.origin + centreColumn * plane.columnStep;

  fan = options.probe != ProbeKind::Linear;
  double margin = Reach * options.lateralSigma;
  if (fan)
  {
    const double halfAngle = options.halfAngle * Pi / 180;
    apex = options.probeRadius * std::cos(halfAngle);
    firstRange = options.probeRadius;
    lastRange = apex + (options.height - 1) * options.pixelSize;
    lastRange = std::max(lastRange, firstRange);
    lastLine = halfAngle;
    lineStep = options.lateralSigma / Oversampling / lastRange;
    margin = std::min(margin / firstRange, 3.1 - halfAngle);
  }
  else
  {
    apex = 0;
    firstRange = 0;
    lastRange = (height - 1) * pixelHeight;
    lastLine = centreColumn * pixelWidth;
    lineStep = options.lateralSigma / Oversampling;
  }
  rangeStep = options.axialSigma / Oversampling;

  const double half = std::ceil((lastLine + margin) / lineStep);
  const double padding = std::ceil(Reach * Oversampling);
  const double deep = std::ceil((lastRange - firstRange) / rangeStep) + 1;
  const double samples = (2 * half + 1) * (deep + 2 * padding);
  const double area = (lastRange - firstRange + 2 * Reach * options.axialSigma) *
                      ((fan ? 2 * lastLine * lastRange : 2 * lastLine) + 2 * Reach * options.lateralSigma);
  const double scatterers = area * 2 * Reach * options.elevationSigma * options.scattererDensity;
  if (!(plane.NumberOfPixels() <= (std::size_t(1) << 28) && samples <= std::ldexp(1.0, 26) &&
        scatterers <= std::ldexp(1.0, 30)))
  {
    throw Error("phantom plane: " + std::to_string(width) + " x " + std::to_string(height) + " pixels of " +
                std::to_string(a) + " x " + std::to_string(b) +
                " mm are too large an image to simulate (at most 2^28 pixels, 2^26 echo samples and 2^30 "
                "scatterers); ask for a smaller plane.");
  }
  if (!(face.cwiseAbs().maxCoeff() <= 1e6))
  {
    throw Error("phantom plane: it lies more than 1e6 mm from the phantom's origin; are the pose's units mm?");
  }
  lines = static_cast<int>(2 * half) + 1;
  ranges = static_cast<int>(deep + 2 * padding) + 1;
  gridLine = -half * lineStep;
  gridRange = firstRange - padding * rangeStep;
  firstLitLine = std::max(0, static_cast<int>(half - std::ceil(lastLine / lineStep)) - 1);
  lastLitLine = lines - 1 - firstLitLine;
  firstLitRange = static_cast<int>(padding);
  lastLitRange = static_cast<int>(padding + deep);
}

// ---- scatterers of a slab ----

struct Scatterer
{
  BeamPoint place;
  double elevation;  // mm out of the plane
  double amplitude;
};

/// A box in the aperture's frame that holds every scatterer which can reach the image, and a finer test.
class Slab
{
public:
  Slab(const PhantomOptions& options, const Aperture& aperture)
      : aperture_(aperture),
        sideways_(Reach * options.lateralSigma),
        along_(Reach * options.axialSigma),
        thickness_(Reach * options.elevationSigma)
  {
    const Aperture& p = aperture;
    if (!p.fan)
    {
      low_ = {-p.lastLine - sideways_, p.firstRange - along_, -thickness_};
      high_ = {p.lastLine + sideways_, p.lastRange + along_, thickness_};
      return;
    }
    const double angle = -p.gridLine, outer = p.lastRange + along_;
    const double right = outer * std::sin(std::min(angle, Pi / 2));
    const double top = std::cos(angle) * (angle > Pi / 2 ? outer : std::max(p.firstRange - along_, 0.0));
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
    return aperture_.fan ? beyond * p.range <= sideways_ + Pi / 2 * radius : beyond <= sideways_ + radius;
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

/// Amplitude of the scatterer that 32 random bits may have put at a point, 0 when there is none; parenchyma's
/// are 1. `share` is the probability of one in parenchyma. Equal amplitudes, a fixed number to a cell, bring
/// the sum closest to fully developed speckle for a given density.
double AmplitudeAt(const PhantomOptions& options, const Eigen::Vector3d& point, double share, std::uint32_t chance)
{
  const bool organ = options.scene == PhantomScene::Organ;
  const Tissue kind = organ ? OrganAt(point) : Tissue::Parenchyma;
  const TissueProperties& tissue = PropertiesOf(kind);
  if (Uniform(chance) >= share * tissue.density)
  {
    return 0;
  }
  return tissue.amplitude * (organ && kind == Tissue::Parenchyma ? ParenchymaTexture(point) : 1);
}

/// Calls visit(Scatterer) for every scatterer that can reach the image, in an order that depends on the plane
/// only. The world is not stored: a hash of the seed and the cell places each cell's scatterers.
template <class Visit>
void ForEachScatterer(const PhantomOptions& options, const Aperture& aperture, const Slab& slab, Visit&& visit)
{
  const auto offer = [&](const Eigen::Vector3d& point, auto&& amplitude)
  {
    const Eigen::Vector3d offset = point - aperture.face;
    const double z = aperture.elevation.dot(offset);
    if (std::abs(z) > slab.Thickness())
    {
      return;
    }
    const BeamPoint place = aperture.ToBeam(aperture.lateral.dot(offset), aperture.axial.dot(offset));
    if (!slab.Reaches(place, 0))
    {
      return;
    }
    const double value = amplitude();
    if (value != 0)
    {
      visit(Scatterer{place, z, value});
    }
  };

  if (options.scene == PhantomScene::Points)
  {
    constexpr double pitch = 10;           // mm
    constexpr double pointAmplitude = 10;  // +20 dB
    ForEachCell(aperture, slab, pitch / 2,
                [&](const std::array<std::int64_t, 3>& c)
                {
                  // Cells of half the pitch: the point is the low corner of every cell with even, odd, even
                  // index.
                  if (c[0] % 2 == 0 && c[1] % 2 != 0 && c[2] % 2 == 0)
                  {
                    offer(Eigen::Vector3d(c[0], c[1], c[2]) * (pitch / 2), [] { return pointAmplitude; });
                  }
                });
    return;
  }

  constexpr double cell = 0.5;  // mm
  const double expected = options.scattererDensity * cell * cell * cell;
  const int perCell = static_cast<int>(std::ceil(expected));
  // In the sum's unit parenchyma's root mean square is 1: n <a^2> times the integral of the squared profile.
  const double unit = 1 / std::sqrt(options.scattererDensity * std::pow(Pi, 1.5) * options.axialSigma *
                                    options.lateralSigma * options.elevationSigma);
  const std::uint64_t world = Mix(options.seed);
  ForEachCell(aperture, slab, cell,
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
                      Eigen::Vector3d(c[0] + inside(0), c[1] + inside(21), c[2] + inside(42)) * cell;
                  const std::uint32_t chance = static_cast<std::uint32_t>(Mix(hash + 2 * k + 1));
                  offer(point, [&] { return unit * AmplitudeAt(options, point, expected / perCell, chance); });
                }
              });
}

// ---- echoes ----

using Complex = std::complex<float>;

/// Two-way gain along every line relative to parenchyma, averaged over the elevation profile and applied to
/// the grid.
void Attenuate(const PhantomOptions& options, const Aperture& aperture, std::vector<Complex>& grid)
{
  constexpr double step = 0.3;  // mm along a line
  constexpr int stride = 3;     // lines: one lateral standard deviation at the deepest range
  constexpr double node[5] = {0, 1.3556261799742659, -1.3556261799742659, 2.8569700138728056, -2.8569700138728056};
  constexpr double weight[5] = {8.0 / 15, 0.2220759220056126, 0.2220759220056126, 0.0112574113277207,
                                0.0112574113277207};  // Gauss and Hermite, exact to degree 9
  // Natural logarithm of amplitude, both ways, per mm: dB / (cm MHz) times MHz.
  const double perMillimetre = 2 * options.attenuation * options.frequency / 10 * std::log(10.0) / 20;

  const int columns = (aperture.lines - 1 + stride - 1) / stride + 1;
  const double deepest = aperture.gridRange + (aperture.ranges - 1) * aperture.rangeStep;
  const int rows = static_cast<int>(std::ceil((deepest - aperture.firstRange) / step)) + 2;
  std::vector<float> gain(static_cast<std::size_t>(rows) * columns, 0.0f);
  for (int column = 0; column < columns; ++column)
  {
    const double line = aperture.gridLine + column * stride * aperture.lineStep;
    for (int q = 0; q < 5; ++q)
    {
      double exponent = 0;
      for (int row = 0; row < rows; ++row)
      {
        gain[static_cast<std::size_t>(row) * columns + column] += static_cast<float>(weight[q] * std::exp(-exponent));
        const Eigen::Vector3d point =
            aperture.ToWorld({aperture.firstRange + (row + 0.5) * step, line}, node[q] * options.elevationSigma);
        exponent += (PropertiesOf(OrganAt(point)).attenuation - 1) * perMillimetre * step;
      }
    }
  }

  for (int r = 0; r < aperture.ranges; ++r)
  {
    const double depth = std::max(aperture.gridRange + r * aperture.rangeStep - aperture.firstRange, 0.0) / step;
    const int row = static_cast<int>(depth);
    const float down = static_cast<float>(depth - row);
    const float* above = &gain[static_cast<std::size_t>(row) * columns];
    const float* below = above + columns;
    Complex* samples = &grid[static_cast<std::size_t>(r) * aperture.lines];
    for (int l = 0; l < aperture.lines; ++l)
    {
      const int column = l / stride;
      const int next = std::min(column + 1, columns - 1);
      const float right = static_cast<float>(l % stride) / stride;
      const float left = (1 - down) * above[column] + down * below[column];
      samples[l] *= left + right * ((1 - down) * above[next] + down * below[next] - left);
    }
  }
}

/// Taps 0 .. n of a symmetric filter that turns bilinearly deposited impulses into Gaussians of peak 1 and of
/// standard deviation `sigma` samples once they are read bilinearly: each of the two adds 1/6 to the
/// variance.
std::vector<float> GaussianTaps(double sigma)
{
  const double variance = sigma * sigma - 1.0 / 3;
  std::vector<float> taps(static_cast<std::size_t>(std::ceil(Reach * sigma)) + 1);
  for (std::size_t k = 0; k < taps.size(); ++k)
  {
    taps[k] = static_cast<float>(sigma / std::sqrt(variance) * std::exp(-0.5 * k * k / variance));
  }
  return taps;
}

/// out[i] += factor * in[i] for n complex numbers.
void AddScaled(Complex* out, const Complex* in, float factor, int n)
{
  float* o = reinterpret_cast<float*>(out);
  const float* s = reinterpret_cast<const float*>(in);
  for (int i = 0; i < 2 * n; ++i)
  {
    o[i] += factor * s[i];
  }
}

/// Demodulated echoes at the lit lines and ranges, [ranges][lines] of the whole grid.
std::vector<Complex> SumEchoes(const PhantomOptions& options, const Aperture& aperture)
{
  const int lines = aperture.lines;
  std::vector<Complex> grid(static_cast<std::size_t>(lines) * aperture.ranges);

  // Impulses: exact elevation weight and carrier phase, bilinear place. The profile in range and line comes
  // after.
  const Slab slab(options, aperture);
  const double elevation = -0.5 / (options.elevationSigma * options.elevationSigma);
  const double twiceWavenumber = 4 * Pi * options.frequency / SpeedOfSound;
  ForEachScatterer(options, aperture, slab,
                   [&](const Scatterer& s)
                   {
                     const BeamPoint& p = s.place;
                     const double r = (p.range - aperture.gridRange) / aperture.rangeStep;
                     const double l = (p.line - aperture.gridLine) / aperture.lineStep;
                     if (!(r >= 0 && l >= 0 && r < aperture.ranges - 1 && l < lines - 1))
                     {
                       return;
                     }
                     const int ri = static_cast<int>(r), li = static_cast<int>(l);
                     const float rf = static_cast<float>(r - ri), lf = static_cast<float>(l - li);
                     const double amplitude = s.amplitude * std::exp(elevation * s.elevation * s.elevation);
                     const double phase = -twiceWavenumber * p.range;
                     const Complex echo(static_cast<float>(amplitude * std::cos(phase)),
                                        static_cast<float>(amplitude * std::sin(phase)));
                     Complex* at = &grid[static_cast<std::size_t>(ri) * lines + li];
                     at[0] += (1 - rf) * (1 - lf) * echo;
                     at[1] += (1 - rf) * lf * echo;
                     at[lines] += rf * (1 - lf) * echo;
                     at[lines + 1] += rf * lf * echo;
                   });

  if (options.scene == PhantomScene::Organ)
  {
    Attenuate(options, aperture, grid);
  }

  const std::vector<float> axial = GaussianTaps(Oversampling);
  std::vector<Complex> echoes(grid.size());
  std::vector<Complex> row(lines);
  for (int r = aperture.firstLitRange; r <= aperture.lastLitRange; ++r)
  {
    std::fill(row.begin(), row.end(), Complex(0));
    for (int k = 1 - static_cast<int>(axial.size()); k < static_cast<int>(axial.size()); ++k)
    {
      if (r + k >= 0 && r + k < aperture.ranges)
      {
        AddScaled(row.data(), &grid[static_cast<std::size_t>(r + k) * lines], axial[std::abs(k)], lines);
      }
    }
    const double range = aperture.gridRange + r * aperture.rangeStep;
    const std::vector<float> lateral = GaussianTaps(options.lateralSigma / aperture.MillimetresPerLine(range));
    Complex* out = &echoes[static_cast<std::size_t>(r) * lines];
    for (int k = 1 - static_cast<int>(lateral.size()); k < static_cast<int>(lateral.size()); ++k)
    {
      const int from = std::max(aperture.firstLitLine, -k);
      const int to = std::min(aperture.lastLitLine, lines - 1 - k);
      AddScaled(out + from, &row[from + k], lateral[std::abs(k)], to - from + 1);
    }
  }
  return echoes;
}

/// The echo at every pixel, read bilinearly before detection so that its statistics stay those of a sum of
/// echoes.
void ScanConvert(const Aperture& aperture, const std::vector<Complex>& echoes, Complex* image)
{
  for (int j = 0; j < aperture.height; ++j)
  {
    for (int i = 0; i < aperture.width; ++i)
    {
      const BeamPoint p = aperture.PixelToBeam(i, j);
      Complex& pixel = image[static_cast<std::size_t>(j) * aperture.width + i];
      if (!aperture.IsLit(p))
      {
        pixel = 0;
        continue;
      }
      const double r = (p.range - aperture.gridRange) / aperture.rangeStep;
      const double l = (p.line - aperture.gridLine) / aperture.lineStep;
      const int ri = std::clamp(static_cast<int>(r), aperture.firstLitRange, aperture.lastLitRange - 1);
      const int li = std::clamp(static_cast<int>(l), aperture.firstLitLine, aperture.lastLitLine - 1);
      const float rf = static_cast<float>(r - ri), lf = static_cast<float>(l - li);
      const Complex* at = &echoes[static_cast<std::size_t>(ri) * aperture.lines + li];
      const Complex above = (1 - lf) * at[0] + lf * at[1];
      const Complex below = (1 - lf) * at[aperture.lines] + lf * at[aperture.lines + 1];
      pixel = (1 - rf) * above + rf * below;
    }
  }
}

SlicePlane PlaneOf(const Eigen::Matrix4d& pose, const PhantomOptions& options)
{
  return SlicePlane::FromImageToReference(pose, options.width, options.height);
}

/// The pose of an image whose first row's middle is at `face` and whose axes are the columns of `axes`.
Eigen::Matrix4d PoseAt(const Eigen::Vector3d& face, const Eigen::Matrix3d& axes, const PhantomOptions& options)
{
  SlicePlane plane;
  plane.columnStep = options.pixelSize * axes.col(0);
  plane.rowStep = options.pixelSize * axes.col(1);
  plane.origin = face - 0.5 * (options.width - 1) * plane.columnStep;
  return plane.ImageToReference();
}

}  // namespace

void PhantomOptions::Validate() const
{
  const auto check = [](const char* name, double value, double low, double high, const char* unit)
  {
    if (!(value >= low && value <= high))
    {
      const auto text = [](double v)
      {
        std::string s = std::to_string(v);
        s.erase(s.find_last_not_of('0') + 1);
        return s.back() == '.' ? s.substr(0, s.size() - 1) : s;
      };
      throw Error("phantom: " + std::string(name) + " is " + text(value) + "; it must lie between " + text(low) +
                  " and " + text(high) + unit + ".");
    }
  };
  check("scene", static_cast<int>(scene), 0, 2, "");
  check("probe", static_cast<int>(probe), 0, 2, "");
  check("frames", frames, 1, 100000, "");
  if (width != 0)
  {
    check("width", width, 8, 8192, " pixels (or 0 for the probe's default)");
  }
  check("height", height, 8, 8192, " pixels");
  check("pixelSize", pixelSize, 0.01, 5, " mm");
  if (probe != ProbeKind::Linear && probeRadius != 0)
  {
    check("probeRadius", probeRadius, 2, 500, " mm (or 0 for the probe's default)");
  }
  if (probe != ProbeKind::Linear && halfAngle != 0)
  {
    check("halfAngle", halfAngle, 1, 80, " degrees (or 0 for the probe's default)");
  }
  check("frequency", frequency, 0.5, 50, " MHz");
  check("axialSigma", axialSigma, 0.02, 5, " mm");
  check("lateralSigma", lateralSigma, 0.02, 5, " mm");
  check("elevationSigma", elevationSigma, 0.05, 10, " mm");
  check("scattererDensity", scattererDensity, 1, 1000, " per cubic millimetre");
  check("attenuation", attenuation, 0, 3, " dB / (cm MHz)");
  check("dynamicRange", dynamicRange, 10, 120, " dB");
  check("whiteLevel", whiteLevel, -40, 100, " dB");
  check("frameSpacing", frameSpacing, 0, 20, " mm");
  check("speedVariation", speedVariation, 0, 0.95, "");
  check("tilt", tilt, 0, 45, " degrees");
  check("wander", wander, 0, 20, " mm");
  check("sweepAngle", sweepAngle, -360, 360, " degrees");
  check("frameRate", frameRate, 0.1, 10000, " frames a second");
  check("trackingNoise", trackingNoise, 0, 10, " mm");
  check("trackingRotationNoise", trackingRotationNoise, 0, 20, " degrees");
}

Phantom::Phantom(const PhantomOptions& options) : options_(options)
{
  options_.Validate();
  const bool convex = options_.probe == ProbeKind::Convex;
  if (options_.width == 0)
  {
    options_.width = options_.probe == ProbeKind::Linear ? 256 : 384;
  }
  if (options_.probeRadius == 0)
  {
    options_.probeRadius = convex ? 25 : 4;
  }
  if (options_.halfAngle == 0)
  {
    options_.halfAngle = convex ? 32 : 44;
  }

  const PhantomOptions& o = options_;
  std::vector<double> travel(o.frames, 0.0);
  for (int k = 1; k < o.frames; ++k)
  {
    travel[k] = travel[k - 1] + 1 + o.speedVariation * Sway(o.seed, SpeedStream, (k - 0.5) / o.frameRate);
  }
  const double length = (o.frames - 1) * o.frameSpacing;
  const double scale = o.frames > 1 ? length / travel.back() : 0;

  const double degree = Pi / 180;
  const auto rotation = [](const Eigen::Vector3d& vector) -> Eigen::Matrix3d
  {
    const double angle = vector.norm();
    return angle > 0 ? Eigen::AngleAxisd(angle, vector / angle).toRotationMatrix() : Eigen::Matrix3d::Identity();
  };
  const Eigen::Matrix3d turn = rotation(Eigen::Vector3d(0, o.sweepAngle * degree, 0));
  for (int k = 0; k < o.frames; ++k)
  {
    const double seconds = k / o.frameRate;
    Eigen::Vector3d angles, place;
    for (int axis = 0; axis < 3; ++axis)
    {
      angles[axis] = o.tilt * degree * Sway(o.seed, SwayStream + axis, seconds);
    }
    place = {o.wander * Sway(o.seed, SwayStream + 3, seconds), o.wander * Sway(o.seed, SwayStream + 4, seconds),
             scale * travel[k] - 0.5 * length};
    const Eigen::Matrix3d axes = turn * rotation(angles[0] * Eigen::Vector3d::UnitX()) *
                                 rotation(angles[1] * Eigen::Vector3d::UnitY()) *
                                 rotation(angles[2] * Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d face = turn * place;
    truePoses_.push_back(PoseAt(face, axes, o));

    Eigen::Vector3d shift, twist;
    for (int axis = 0; axis < 3; ++axis)
    {
      shift[axis] = o.trackingNoise * Normal(o.seed, PositionNoiseStream + axis, k);
      twist[axis] = o.trackingRotationNoise * degree * Normal(o.seed, RotationNoiseStream + axis, k);
    }
    recordedPoses_.push_back(PoseAt(face + shift, rotation(twist) * axes, o));
  }
  Aperture(options_, TruePlane(0));  // throws for a frame too large to make
}

double Phantom::ScatterersPerResolutionCell() const
{
  return options_.scattererDensity * std::pow(2 * Pi, 1.5) * options_.axialSigma * options_.lateralSigma *
         options_.elevationSigma;
}

SlicePlane Phantom::TruePlane(int frame) const
{
  return PlaneOf(truePoses_.at(frame), options_);
}

SlicePlane Phantom::RecordedPlane(int frame) const
{
  return PlaneOf(recordedPoses_.at(frame), options_);
}

void Phantom::Frame(const SlicePlane& plane, std::uint8_t* image) const
{
  const Aperture aperture(options_, plane);
  std::vector<Complex> echoes(plane.NumberOfPixels());
  ScanConvert(aperture, SumEchoes(options_, aperture), echoes.data());
  const float white = static_cast<float>(options_.whiteLevel);
  const float range = static_cast<float>(options_.dynamicRange);
  for (std::size_t i = 0; i < echoes.size(); ++i)
  {
    // An echo of exactly 0 (outside the fan, or far from every scatterer) has no logarithm: black.
    const float intensity = std::norm(echoes[i]);
    const float level = intensity > 0 ? 1 + (10 * std::log10(intensity) - white) / range : 0;
    image[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(level, 0.0f, 1.0f)));
  }
}

void Phantom::Echo(const SlicePlane& plane, std::complex<float>* image) const
{
  const Aperture aperture(options_, plane);
  ScanConvert(aperture, SumEchoes(options_, aperture), image);
}

std::vector<std::uint8_t> Phantom::Mask(const SlicePlane& plane) const
{
  const Aperture aperture(options_, plane);
  std::vector<std::uint8_t> mask(plane.NumberOfPixels());
  for (int j = 0; j < plane.height; ++j)
  {
    for (int i = 0; i < plane.width; ++i)
    {
      mask[static_cast<std::size_t>(j) * plane.width + i] = aperture.IsLit(aperture.PixelToBeam(i, j)) ? 1 : 0;
    }
  }
  return mask;
}

Sweep Phantom::MakeSweep(const std::function<bool(double)>& progress) const
{
  const std::size_t frameSize = static_cast<std::size_t>(options_.width) * options_.height;
  std::shared_ptr<std::vector<std::uint8_t>> pixels;
  try
  {
    pixels = std::make_shared<std::vector<std::uint8_t>>(frameSize * options_.frames);
  }
  catch (const std::bad_alloc&)
  {
    throw Error("phantom: no memory for " + std::to_string(frameSize * options_.frames) +
                " pixels; ask for fewer or smaller frames.");
  }

  // Frames are independent, so any grouping gives the same bits. Groups as large as the pool keep progress on
  // the calling thread.
  const int group = std::max(1, tbb::this_task_arena::max_concurrency());
  for (int first = 0; first < options_.frames; first += group)
  {
    if (progress && !progress(static_cast<double>(first) / options_.frames))
    {
      return {};
    }
    tbb::parallel_for(first, std::min(first + group, options_.frames),
                      [&](int k) { Frame(TruePlane(k), pixels->data() + k * frameSize); });
  }
  if (progress && !progress(1.0))
  {
    return {};
  }

  Sweep sweep;
  sweep.width = options_.width;
  sweep.height = options_.height;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep.imageToReference = recordedPoses_;
  for (int k = 0; k < options_.frames; ++k)
  {
    sweep.timestamps.push_back(k / options_.frameRate);
  }
  if (options_.probe != ProbeKind::Linear)
  {
    sweep.mask = std::make_shared<const std::vector<std::uint8_t>>(Mask(TruePlane(0)));
  }
  return sweep;
}

Sweep Phantom::MakeTruth(const SlicePlane& plane) const
{
  Aperture(options_, plane);  // throws before anything is allocated
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(plane.NumberOfPixels());
  Frame(plane, pixels->data());
  Sweep sweep;
  sweep.width = plane.width;
  sweep.height = plane.height;
  sweep.pixels = std::shared_ptr<const void>(pixels, pixels->data());
  sweep.imageToReference = {plane.ImageToReference()};
  if (options_.probe != ProbeKind::Linear)
  {
    sweep.mask = std::make_shared<const std::vector<std::uint8_t>>(Mask(plane));
  }
  return sweep;
}

Tissue Phantom::TissueAt(const Eigen::Vector3d& point) const
{
  return options_.scene == PhantomScene::Organ ? OrganAt(point) : Tissue::Parenchyma;
}

}  // namespace bigus
