// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A million small fields, each from its own seed, drawn from everything at once: every number an engine gives
// is finite, and none is further from the reference's than tolerance and rounding explain. Whatever fails is
// reproduced by its seed alone.

#include <algorithm>
#include <atomic>
#include <mutex>
#include <thread>

#include "Core/Model/Error.h"
#include "Stability/HardCases.h"

namespace
{

using namespace bigus;
using namespace bigus::test;

constexpr std::uint64_t kFields = 1000000;

/// Numbers from a seed, cheaper to start than std::mt19937_64 (splitmix64).
class Dice
{
public:
  explicit Dice(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15u + 1) {}
  std::uint64_t Bits()
  {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  double Uniform(double low = 0, double high = 1)
  {
    return low + (high - low) * (static_cast<double>(Bits() >> 11) * 0x1p-53);
  }
  double LogUniform(double low, double high) { return std::exp(Uniform(std::log(low), std::log(high))); }
  bool Chance(double p) { return Uniform() < p; }
  int Integer(int low, int high) { return low + static_cast<int>(Bits() % static_cast<std::uint64_t>(high - low + 1)); }
  Eigen::Vector3d Vector(double half) { return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)}; }
  /// Not uniform over the rotations, but every axis and its neighbourhood are common.
  Eigen::Vector4d Quaternion()
  {
    const Eigen::Vector4d q(Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1));
    Eigen::Vector4d sparse = q;
    for (int k = 0; k < 4; ++k)
    {
      sparse[k] *= Chance(0.2) ? (Chance(0.5) ? 0.0 : 1e-4) : 1.0;
    }
    return sparse.norm() > 0 ? sparse : q;
  }

private:
  std::uint64_t state_;
};

struct Scene
{
  SlicePlane plane;
  GaussianField field;
  Accuracy accuracy;
};

SlicePlane WildPlane(Dice& dice)
{
  SlicePlane plane;
  const Eigen::Matrix3d turn = RotationMatrix(dice.Quaternion());
  const double pixel = dice.Chance(0.5) ? dice.LogUniform(0.05, 1) : dice.LogUniform(1e-5, 10);
  // Sides from 2e-6 mm, twice what a plane may have.
  const double stretch = dice.Chance(0.2) ? dice.LogUniform(std::max(1e-2, 2e-6 / pixel), 1e2) : 1.0;
  const double angle = dice.Chance(0.1) ? dice.Uniform(0.3, 2.8) : M_PI / 2;
  plane.columnStep = pixel * turn.col(0);
  plane.rowStep = pixel * stretch * (std::cos(angle) * turn.col(0) + std::sin(angle) * turn.col(1));
  // Mostly tiny; one in eight spans several vectors and stretches of rows.
  const bool large = dice.Chance(0.125);
  plane.width = dice.Integer(1, large ? 45 : 9);
  plane.height = dice.Integer(1, large ? 40 : 7);
  plane.origin = -0.5 * (plane.width - 1) * plane.columnStep - 0.5 * (plane.height - 1) * plane.rowStep;
  return plane;
}

void WildGaussian(Dice& dice, const SlicePlane& plane, GaussianField& field, std::size_t i)
{
  const double pixel = plane.PixelSize();
  if (i > 0 && dice.Chance(0.2))
  {
    // The one before, or nearly, with the opposite sign.
    const bool exact = dice.Chance(0.5);
    field.means[i] = field.means[i - 1] + (exact ? 0.0 : 0.3) * dice.Vector(field.scales[i - 1].minCoeff());
    field.scales[i] = field.scales[i - 1];
    field.rotations[i] = field.rotations[i - 1];
    field.reflectivities[i] = -field.reflectivities[i - 1];
    return;
  }
  // In pixels; the thinnest axis too has 1e-4 of them at least, and a picometre, below which engines need not
  // look.
  const double least = std::max(1e-4, 1e-9 / pixel);
  const double size = dice.LogUniform(least, 1e4);
  const double aspect = dice.Chance(0.3) ? 1.0 : dice.LogUniform(1, 1e6);
  const double thin = std::max(size / aspect, least);
  Eigen::Vector3d scale(size, dice.Chance(0.5) ? size : thin, thin);
  if (dice.Chance(0.2))
  {
    scale[1] = dice.LogUniform(thin, size * 1.000001);
  }
  std::swap(scale[0], scale[dice.Integer(0, 2)]);
  field.scales[i] = pixel * scale;
  field.rotations[i] = dice.Quaternion() * (dice.Chance(0.3) ? dice.LogUniform(1e-150, 1e150) : 1.0);
  field.reflectivities[i] =
      (dice.Chance(0.4) ? -1 : 1) * (dice.Chance(0.3) ? dice.LogUniform(1e-12, 1e12) : dice.Uniform(0, 1));
  if (dice.Chance(0.1))
  {
    field.means[i] = dice.Vector(1e3 * pixel);
    return;
  }
  const double rho = dice.Chance(0.15) ? dice.LogUniform(3, 1e3) : dice.Uniform(-3, 3);
  PlaceInView(field, i, plane, dice.Integer(0, plane.width - 1), dice.Integer(0, plane.height - 1),
              {dice.Uniform(-2, 2), dice.Uniform(-2, 2)}, rho);
}

Scene WildScene(std::uint64_t seed)
{
  Dice dice(seed);
  Scene scene;
  scene.plane = WildPlane(dice);
  GaussianField& field = scene.field;
  field.Resize(static_cast<std::size_t>(dice.Integer(1, 6)));
  field.beam.elevationSigma = dice.Chance(0.25) ? 0.0 : dice.LogUniform(1e-6, 1e3);
  field.transfer.gamma = dice.LogUniform(1e-3, 10);
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    WildGaussian(dice, scene.plane, field, i);
  }
  if (dice.Chance(0.1))
  {
    const Eigen::Vector3d far = dice.Vector(1e5);
    scene.plane.origin += far;
    for (Eigen::Vector3d& mean : field.means)
    {
      mean += far;
    }
  }
  scene.accuracy.tolerance = dice.Chance(0.3) ? 0.0 : dice.LogUniform(1e-6, 1e-1);
  scene.accuracy.direct = dice.Chance(0.2);
  return scene;
}

/// What one thread found.
struct Findings
{
  std::uint64_t fields = 0, nonFinite = 0, beyond = 0, thrown = 0;
  std::uint64_t tight = 0;  ///< fields whose allowance is below 1 % of their splats' peaks
  std::uint64_t firstNonFinite = kFields, firstBeyond = kFields, firstThrown = kFields;
  double excess = 0;

  void Add(const Findings& other)
  {
    fields += other.fields;
    nonFinite += other.nonFinite;
    tight += other.tight;
    beyond += other.beyond;
    thrown += other.thrown;
    firstNonFinite = std::min(firstNonFinite, other.firstNonFinite);
    firstBeyond = std::min(firstBeyond, other.firstBeyond);
    firstThrown = std::min(firstThrown, other.firstThrown);
    excess = std::max(excess, other.excess);
  }
};

/// Two engines, reused for field after field.
class Examiner
{
public:
  explicit Examiner(const std::string& name)
      : engine_(Engine::Create(name)), reference_(Engine::Create("reference")), unit_(UnitRoundoff(name))
  {
  }

  void Examine(std::uint64_t seed)
  {
    ++findings_.fields;
    try
    {
      const Scene scene = WildScene(seed);
      bool finite = Rendered(scene, seed);
      if (seed % 4 == 1)
      {
        finite = Trained(scene, seed) && finite;
      }
      if (!finite)
      {
        ++findings_.nonFinite;
        findings_.firstNonFinite = std::min(findings_.firstNonFinite, seed);
      }
    }
    catch (const Error&)
    {
      ++findings_.thrown;
      findings_.firstThrown = std::min(findings_.firstThrown, seed);
    }
  }

  const Findings& Result() const { return findings_; }

private:
  bool Rendered(const Scene& scene, std::uint64_t seed)
  {
    const GaussianField& field = scene.field;
    const ViewOutput output = seed % 4 ? ViewOutput::Scattering : ViewOutput::Intensity;
    reference_->SetField(field);
    engine_->SetAccuracy(scene.accuracy);
    engine_->SetField(field);
    const Image expected = RenderWhole(*reference_, scene.plane, output);
    const Image actual = RenderWhole(*engine_, scene.plane, output);

    // On S: what may be dropped, what rounding may do to each splat, to their sum (whose terms are at most
    // the splats' peaks) and to the image. I moves at most gamma times as much.
    double allowed = scene.accuracy.tolerance / field.transfer.gamma, peaks = 0;
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      const double magnitude = std::abs(field.reflectivities[i]);
      allowed += magnitude * SplatErrorBound(field, i, scene.plane, unit_);
      peaks += magnitude * static_cast<double>(ExactSplat(field, i, scene.plane).PeakOfAllPlanes());
    }
    allowed += static_cast<double>(field.Size()) * (unit_ + kFloatRounding) * peaks;
    findings_.tight += allowed < 0.01 * peaks;
    if (output == ViewOutput::Intensity)
    {
      allowed = allowed * field.transfer.gamma + 2 * kFloatRounding;
    }
    double worst = 0;
    bool finite = true;
    for (std::size_t p = 0; p < actual.values.size(); ++p)
    {
      const float value = actual.values[p], coverage = actual.coverage[p];
      finite = finite && std::isfinite(value) && std::isfinite(coverage) && coverage >= 0 &&
               (output == ViewOutput::Scattering || (value >= 0 && value <= 1));
      worst = std::max(worst, std::abs(static_cast<double>(value) - expected.values[p]));
    }
    // Below the smallest normal float nothing is promised.
    allowed += 1e-37;
    findings_.excess = std::max(findings_.excess, worst / allowed);
    if (worst > allowed)
    {
      ++findings_.beyond;
      findings_.firstBeyond = std::min(findings_.firstBeyond, seed);
    }
    return finite;
  }

  /// A gradient and two steps on frames that are black, white or noise.
  bool Trained(const Scene& scene, std::uint64_t seed)
  {
    Dice dice(~seed);
    auto sweep = std::make_shared<Sweep>();
    sweep->width = scene.plane.width;
    sweep->height = scene.plane.height;
    sweep->pixelType = Sweep::PixelType::UInt8;
    sweep->imageToReference.push_back(scene.plane.ImageToReference());
    const auto pixels = std::make_shared<std::vector<std::uint8_t>>(scene.plane.NumberOfPixels());
    const int kind = dice.Integer(0, 2);
    for (std::uint8_t& pixel : *pixels)
    {
      pixel = static_cast<std::uint8_t>(kind == 0 ? 0 : kind == 1 ? 255 : dice.Integer(0, 255));
    }
    sweep->pixels = std::shared_ptr<const void>(pixels, pixels->data());
    engine_->SetFrames(sweep);
    const Loss loss = Loss::Parse(dice.Chance(0.5) ? "l1" : "l2");
    bool finite = std::isfinite(engine_->Backpropagate({0}, loss)) && CountNonFinite(engine_->GetGradient()) == 0;
    const double rate = dice.LogUniform(1e-4, 1e2);
    for (int step = 0; step < 2; ++step)
    {
      finite = std::isfinite(engine_->TrainStep({0}, loss, {rate, rate, rate, rate}, {})) && finite;
    }
    return CountNonFinite(engine_->GetField()) == 0 && finite;
  }

  std::unique_ptr<Engine> engine_, reference_;
  double unit_;
  Findings findings_;
};

class RandomFields : public EngineTest
{
};

TEST_P(RandomFields, AMillionOfThem)
{
  const std::uint64_t fields = IsEmulated(GetParam()) ? kFields / 1000 : kFields;
  // Each thread has engines of its own; which thread examines a seed changes nothing.
  std::atomic<std::uint64_t> next{0};
  std::mutex mutex;
  Findings all;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < std::max(1u, std::thread::hardware_concurrency()); ++t)
  {
    threads.emplace_back(
        [&]
        {
          Examiner examiner(GetParam());
          const std::uint64_t batch = std::min<std::uint64_t>(fields / 10, 1000);
          for (std::uint64_t begin; (begin = next.fetch_add(batch)) < fields;)
          {
            for (std::uint64_t seed = begin; seed < begin + batch; ++seed)
            {
              examiner.Examine(seed);
            }
          }
          const std::lock_guard<std::mutex> lock(mutex);
          all.Add(examiner.Result());
        });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  Conclude("random", "a million fields, error over what is allowed", GetParam(), all.excess, all.excess, all.nonFinite);
  Conclude("random", "of which held to 1 % of their peaks", GetParam(),
           static_cast<double>(all.tight) / static_cast<double>(fields), kOnlyStated, 0);
  EXPECT_EQ(all.fields, fields);
  EXPECT_EQ(all.nonFinite, 0u) << "first: seed " << all.firstNonFinite;
  EXPECT_EQ(all.beyond, 0u) << "first: seed " << all.firstBeyond;
  EXPECT_EQ(all.thrown, 0u) << "first: seed " << all.firstThrown;
}

INSTANTIATE_TEST_SUITE_P(Engines, RandomFields, ::testing::ValuesIn(FastEngines()), NameOf);

}  // namespace
