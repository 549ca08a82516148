// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/QuasiNewton.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "Core/Engine/Packing.h"
#include "Core/Numerics/Constants.h"

namespace bigus
{
namespace
{

constexpr std::size_t kPairs = 8;     // 5 lose 0.1 dB, 20 gain 0.05 (a cube of 48 voxels a side, 200 passes)
constexpr int kMatrixSteps = 20;      // steps after which the first matrix is measured anew
constexpr double kRidge = 0.1;        // of the median of m r^2: holds Gaussians of little energy
constexpr double kFirstScale = 0.3;   // of a step without a pair, which knows no curvature between Gaussians
constexpr int kMostTrials = 8;        // of shorter steps, before pairs are forgotten
constexpr double kSeen = 5;           // standard deviations beyond which a plane sees nothing of a Gaussian
constexpr double kRound = 1e-5;       // of two scales' ratio less 1, below which how
                                      // they turn cannot be told
constexpr std::size_t kBlock = 1024;  // Gaussians that one thread takes, and whose sums are added in order
constexpr std::size_t kBatchPixels = std::size_t(1) << 24;  // rendered at once

// Where the numbers of a Gaussian begin.
constexpr std::size_t kShift = 1, kShape = 4;

/// The row and column of each number of E.
constexpr std::array<std::array<int, 2>, 6> kElements = {{{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}}};

template <class Body>
void ForBlocks(std::size_t count, const Body& body)
{
  tbb::parallel_for(std::size_t(0), (count + kBlock - 1) / kBlock,
                    [&](std::size_t block) { body(block, block * kBlock, std::min(count, (block + 1) * kBlock)); });
}

/// The scalar product, in an order that does not depend on threads.
double Dot(const std::vector<float>& a, const std::vector<float>& b)
{
  std::vector<double> sums((a.size() + kBlock - 1) / kBlock);
  ForBlocks(a.size(),
            [&](std::size_t block, std::size_t begin, std::size_t end)
            {
              double sum = 0;
              for (std::size_t i = begin; i < end; ++i)
              {
                sum += static_cast<double>(a[i]) * b[i];
              }
              sums[block] = sum;
            });
  double sum = 0;
  for (const double part : sums)
  {
    sum += part;
  }
  return sum;
}

/// a += factor b
void Add(std::vector<float>& a, double factor, const std::vector<float>& b)
{
  ForBlocks(a.size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                a[i] = static_cast<float>(a[i] + factor * b[i]);
              }
            });
}

/// E of a Gaussian's numbers, those beside the diagonal times `apart`.
Eigen::Matrix3d ShapeOf(const float* numbers, float apart = 1)
{
  Eigen::Matrix3d shape;
  for (std::size_t k = 0; k < kElements.size(); ++k)
  {
    const int row = kElements[k][0], column = kElements[k][1];
    shape(row, column) = shape(column, row) = numbers[kShape + k] * (row == column ? 1 : apart);
  }
  return shape;
}

void SetShape(const Eigen::Matrix3d& shape, double apart, float* numbers)
{
  for (std::size_t k = 0; k < kElements.size(); ++k)
  {
    const int row = kElements[k][0], column = kElements[k][1];
    numbers[kShape + k] = static_cast<float>(shape(row, column) * (row == column ? 1 : apart));
  }
}

Eigen::Matrix3d Exponential(const Eigen::Matrix3d& symmetric)
{
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(symmetric);
  return solver.eigenvectors() * solver.eigenvalues().array().exp().matrix().asDiagonal() *
         solver.eigenvectors().transpose();
}

/// R diag(s) of a Gaussian.
Eigen::Matrix3d AxesOf(const GaussianField& field, std::size_t i)
{
  return RotationMatrix(field.rotations[i].normalized()) * field.scales[i].asDiagonal();
}

/// sum_p w(p)^2 of every Gaussian over the pixels of the planes: pi a^2 / det U
/// a plane.
std::vector<float> SquaredFootprints(const GaussianField& field, const std::vector<SlicePlane>& planes)
{
  const std::vector<Gaussian<double>> gaussians = PackField<double>(field, Eigen::Vector3d::Zero());
  std::vector<View<double>> views;
  for (const SlicePlane& plane : planes)
  {
    views.push_back(MakeView<double>(plane, field.beam, Eigen::Vector3d::Zero()));
  }
  std::vector<float> sums(field.Size());
  ForBlocks(field.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                double sum = 0;
                const double radius = field.scales[i].maxCoeff();
                for (const View<double>& view : views)
                {
                  const double far = FromVector3(view.n).dot(field.means[i] - FromVector3(view.origin));
                  if (far * far > kSeen * kSeen * (radius * radius + view.elevationVariance))
                  {
                    continue;
                  }
                  const Splat<double> splat = Project(gaussians[i], view).splat;
                  sum += kPi * splat.amplitude * splat.amplitude / (splat.u11 * splat.u22);
                }
                sums[i] = static_cast<float>(sum);
              }
            });
  return sums;
}

/// The mean of (dI/dS)^2 = (gamma (1 - I))^2 over the counted pixels of the
/// frames.
double MeanSquaredSlope(const Sweep& images, const std::vector<int>& frames, double gamma)
{
  std::vector<float> pixels(images.PixelsPerFrame());
  double sum = 0, count = 0;
  for (const int frame : frames)
  {
    images.CopyFrame(frame, pixels.data());
    for (std::size_t pixel = 0; pixel < pixels.size(); ++pixel)
    {
      if (images.IsLit(pixel))
      {
        sum += (1 - pixels[pixel]) * (1 - pixels[pixel]);
        ++count;
      }
    }
  }
  return count > 0 ? gamma * gamma * sum / count : 1;
}

double Median(std::vector<float> values)
{
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

QuasiNewton::QuasiNewton(Engine& engine, const Sweep& images, const std::vector<int>& frames,
                         const ParameterLimits& limits)
    : engine_(engine), images_(images), frames_(frames), limits_(limits), field_(engine.GetField())
{
  const std::size_t count = field_.Size();
  state_ = {field_.means, std::vector<Eigen::Matrix3d>(count), field_.reflectivities};
  for (std::size_t i = 0; i < count; ++i)
  {
    state_.shapes[i] = AxesOf(field_, i);
  }
  slope_ = MeanSquaredSlope(images, frames, field_.transfer.gamma);
}

double QuasiNewton::Step(const Loss& loss)
{
  if (lossName_ != loss.ToString())
  {
    loss_ = Evaluate(loss);
    lossName_ = loss.ToString();
    pairs_.clear();
    scale_ = 0;
  }
  if (steps_++ % kMatrixSteps == 0)
  {
    MeasureMatrix(loss);
  }
  const State before = state_;
  const Numbers gradient = gradient_;
  const double lossBefore = loss_;
  for (const bool isLast : {false, true})
  {
    const Numbers direction = Direction();
    const double slope = Dot(direction, gradient);
    double length = 1;
    for (int trial = 0; slope < 0 && trial < kMostTrials; ++trial)
    {
      state_ = Moved(before, direction, length);
      SetEngine(state_);
      const double now = Evaluate(loss);
      if (now < lossBefore)
      {
        loss_ = now;
        Numbers step = direction;
        std::transform(step.begin(), step.end(), step.begin(),
                       [length](float c) { return static_cast<float>(length * c); });
        Remember(step, gradient);
        return loss_;
      }
      // The lowest point of the parabola through both losses and the slope.
      const double bend = now - lossBefore - slope * length;
      length *= std::clamp(-0.5 * slope * length / bend, 0.1, 0.5);
    }
    state_ = before;
    gradient_ = gradient;
    pairs_.clear();
    scale_ = 0;
    if (isLast)
    {
      SetEngine(state_);
    }
  }
  return loss_;
}

void QuasiNewton::Save(StateWriter& to) const
{
  const std::size_t count = field_.Size();
  to.Number<std::uint64_t>(count);
  for (std::size_t i = 0; i < count; ++i)
  {
    to.Numbers(state_.means[i].data(), 3);
    to.Numbers(state_.shapes[i].data(), 9);
    to.Number(state_.reflectivities[i]);
  }
  to.Text(lossName_);
  to.Number(loss_);
  to.Number(scale_);
  to.Number(steps_);
  to.Number(passes_);
  to.Number<std::uint64_t>(pairs_.size());
  to.Array(gradient_);
  to.Array(squares_);
  to.Array(ridge_);
  for (const std::array<bool, 3>& axes : clamped_)
  {
    std::for_each(axes.begin(), axes.end(), [&to](bool axis) { to.Flag(axis); });
  }
  for (const Pair& pair : pairs_)
  {
    to.Array(pair.step);
    to.Array(pair.change);
    to.Number(pair.product);
  }
}

void QuasiNewton::Load(StateReader& from)
{
  const std::size_t count = field_.Size();
  StateReader::Require(from.Number<std::uint64_t>() == count, "steps of another number of Gaussians");
  for (std::size_t i = 0; i < count; ++i)
  {
    from.Numbers(state_.means[i].data(), 3);
    from.Numbers(state_.shapes[i].data(), 9);
    state_.reflectivities[i] = from.NumberIn(-GaussianField::kLargestReflectivity, GaussianField::kLargestReflectivity);
    const double volume = state_.shapes[i].determinant();
    StateReader::Require(std::isfinite(volume) && volume != 0, "a Gaussian without volume");
  }
  lossName_ = from.Text();
  loss_ = from.Number<double>();
  scale_ = from.NumberIn(0.0, std::numeric_limits<double>::max());
  steps_ = from.NumberIn(0, std::numeric_limits<int>::max() - 1);
  passes_ = from.NumberIn(0, std::numeric_limits<int>::max() - 1);
  pairs_.resize(from.NumberIn<std::uint64_t>(0, kPairs));
  const auto numbers = [&from](std::size_t wanted)
  {
    Numbers values = from.Array<float>();
    StateReader::Require(values.size() == wanted, "numbers of another field");
    return values;
  };
  gradient_ = numbers(kNumbers * count);
  squares_ = numbers(count);
  ridge_ = numbers(count);
  clamped_.resize(count);
  for (std::array<bool, 3>& axes : clamped_)
  {
    std::generate(axes.begin(), axes.end(), [&from] { return from.Flag(); });
  }
  for (Pair& pair : pairs_)
  {
    pair.step = numbers(kNumbers * count);
    pair.change = numbers(kNumbers * count);
    pair.product = from.NumberIn(std::numeric_limits<double>::min(), std::numeric_limits<double>::max());
  }
  field_ = FieldOf(state_);
}

/// The loss of the engine's field, and its gradient.
double QuasiNewton::Evaluate(const Loss& loss)
{
  const std::size_t batch = std::max<std::size_t>(1, kBatchPixels / images_.PixelsPerFrame());
  double value = 0;
  FieldGradient sum;
  for (std::size_t begin = 0; begin < frames_.size(); begin += batch)
  {
    const std::size_t end = std::min(frames_.size(), begin + batch);
    const double share = static_cast<double>(end - begin) / static_cast<double>(frames_.size());
    value += share * engine_.Backpropagate({frames_.begin() + static_cast<std::ptrdiff_t>(begin),
                                            frames_.begin() + static_cast<std::ptrdiff_t>(end)},
                                           loss);
    FieldGradient part = engine_.GetGradient();
    if (begin == 0 && end == frames_.size())
    {
      sum = std::move(part);
      break;
    }
    if (begin == 0)
    {
      const std::size_t count = field_.Size();
      const std::vector<Eigen::Vector3d> zeros(count, Eigen::Vector3d::Zero());
      sum = {zeros, zeros, zeros, std::vector<double>(count)};
    }
    for (std::size_t i = 0; i < field_.Size(); ++i)
    {
      sum.means[i] += share * part.means[i];
      sum.logScales[i] += share * part.logScales[i];
      sum.rotations[i] += share * part.rotations[i];
      sum.reflectivities[i] += share * part.reflectivities[i];
    }
  }
  ++passes_;
  TakeGradient(sum);
  FindClamped();
  ProjectClamped(gradient_, Of::Gradient);
  return value;
}

/// From the engine's axes R S to those of L: L = R S W with W orthogonal, so E
/// turns with W. A turn about axis i tells of E_jk by (s_j / s_k - s_k / s_j)
/// E_jk, see ProjectAdjoint.
void QuasiNewton::TakeGradient(const FieldGradient& sum)
{
  gradient_.assign(kNumbers * field_.Size(), 0.0f);
  ForBlocks(field_.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                float* const numbers = &gradient_[kNumbers * i];
                const double r = state_.reflectivities[i];
                numbers[0] = static_cast<float>(sum.reflectivities[i]);
                if (r == 0)
                {
                  continue;
                }
                const Eigen::Vector3d shift = state_.shapes[i].transpose() * sum.means[i] / r;
                const Eigen::Vector3d& s = field_.scales[i];
                Eigen::Matrix3d shape = sum.logScales[i].asDiagonal();
                for (int axis = 0; axis < 3; ++axis)
                {
                  const int j = (axis + 1) % 3, k = (axis + 2) % 3;
                  const double ratio = s[j] / s[k] - s[k] / s[j];
                  shape(j, k) = shape(k, j) = std::abs(ratio) > kRound ? sum.rotations[i][axis] / ratio : 0.0;
                }
                const Eigen::Matrix3d turn = AxesOf(field_, i).inverse() * state_.shapes[i];
                shape = turn.transpose() * shape * turn / r;
                for (int k = 0; k < 3; ++k)
                {
                  numbers[kShift + k] = static_cast<float>(shift[k]);
                }
                SetShape(shape, 2, numbers);  // E_jk and E_kj are one number
              }
            });
}

/// Axes at the least or the greatest scale that the gradient would take
/// further.
void QuasiNewton::FindClamped()
{
  constexpr double kAt = 1 + 1e-4;  // engines round scales
  clamped_.assign(field_.Size(), {});
  ForBlocks(field_.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                const Eigen::Vector3d& s = field_.scales[i];
                const bool isLeast = s.minCoeff() <= kAt * limits_.minimumScale;
                const bool isMost = s.maxCoeff() * kAt >= limits_.maximumScale;
                if (!isLeast && !isMost)
                {
                  continue;
                }
                const Eigen::Matrix3d turn = AxesOf(field_, i).inverse() * state_.shapes[i];
                const Eigen::Matrix3d gradient = ShapeOf(&gradient_[kNumbers * i], 0.5f);
                for (int axis = 0; axis < 3; ++axis)
                {
                  const Eigen::Vector3d v = turn.row(axis);
                  const double growth = -state_.reflectivities[i] * v.dot(gradient * v);  // of ln s, down the gradient
                  clamped_[i][axis] = (s[axis] <= kAt * limits_.minimumScale && growth < 0) ||
                                      (s[axis] * kAt >= limits_.maximumScale && growth > 0);
                }
              }
            });
}

/// Takes v v^T (v^T E v) out of E for every clamped axis v: of a step, or of a gradient with respect to E.
void QuasiNewton::ProjectClamped(Numbers& numbers, Of of) const
{
  // A gradient has E_jk and E_kj as one number, so twice of what each has.
  const float apart = of == Of::Gradient ? 0.5f : 1.0f;
  ForBlocks(field_.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                if (!clamped_[i][0] && !clamped_[i][1] && !clamped_[i][2])
                {
                  continue;
                }
                const Eigen::Matrix3d turn = AxesOf(field_, i).inverse() * state_.shapes[i];
                float* const own = &numbers[kNumbers * i];
                Eigen::Matrix3d shape = ShapeOf(own, apart);
                for (int axis = 0; axis < 3; ++axis)
                {
                  if (clamped_[i][axis])
                  {
                    const Eigen::Vector3d v = turn.row(axis).normalized();
                    shape -= v * (v.dot(shape * v)) * v.transpose();
                  }
                }
                SetShape(shape, 1 / apart, own);
              }
            });
}

/// With axes by the eigenvectors of Sigma = L L^T.
GaussianField QuasiNewton::FieldOf(const State& state) const
{
  GaussianField field = field_;
  ForBlocks(
      field.Size(),
      [&](std::size_t, std::size_t begin, std::size_t end)
      {
        for (std::size_t i = begin; i < end; ++i)
        {
          const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(state.shapes[i] * state.shapes[i].transpose());
          Eigen::Matrix3d axes = solver.eigenvectors();
          axes.col(0) *= axes.determinant() < 0 ? -1 : 1;
          field.means[i] = state.means[i];
          field.scales[i] = solver.eigenvalues()
                                .cwiseMax(0)
                                .cwiseSqrt()
                                .cwiseMax(limits_.minimumScale)
                                .cwiseMin(limits_.maximumScale);
          field.rotations[i] = Quaternion(axes);
          field.reflectivities[i] = state.reflectivities[i];
        }
      });
  return field;
}

void QuasiNewton::SetEngine(const State& state)
{
  field_ = FieldOf(state);
  engine_.SetField(field_);
}

QuasiNewton::State QuasiNewton::Moved(const State& from, const Numbers& direction, double length) const
{
  State moved = from;
  const double least = limits_.positiveReflectivity ? 0.0 : -GaussianField::kLargestReflectivity;
  ForBlocks(from.means.size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                const float* const numbers = &direction[kNumbers * i];
                const double r = from.reflectivities[i];
                moved.reflectivities[i] =
                    std::clamp(r + length * numbers[0], least, GaussianField::kLargestReflectivity);
                if (r == 0)
                {
                  continue;
                }
                const Eigen::Vector3d shift(numbers[kShift], numbers[kShift + 1], numbers[kShift + 2]);
                moved.means[i] += from.shapes[i] * shift * (length / r);
                Eigen::Matrix3d shape = from.shapes[i] * Exponential(ShapeOf(numbers) * (length / r));
                // Within the limits of scales: L = U D V^T with D clamped.
                const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(shape * shape.transpose());
                const Eigen::Vector3d s = solver.eigenvalues().cwiseMax(1e-300).cwiseSqrt();
                const Eigen::Vector3d bounded = s.cwiseMax(limits_.minimumScale).cwiseMin(limits_.maximumScale);
                if (bounded != s)
                {
                  shape = solver.eigenvectors() * bounded.cwiseQuotient(s).asDiagonal() *
                          solver.eigenvectors().transpose() * shape;
                }
                moved.shapes[i] = shape;
              }
            });
  return moved;
}

/// m of every Gaussian: what dr alone bends the loss by, (2 / P) sum D^2 w^2 of
/// a loss (I - T)^2, P pixels, D = dI/dS.
void QuasiNewton::MeasureMatrix(const Loss& loss)
{
  std::vector<SlicePlane> planes;
  for (const int frame : frames_)
  {
    planes.push_back(images_.Plane(frame));
  }
  squares_ = SquaredFootprints(field_, planes);
  double pixels = 0;
  for (std::size_t pixel = 0; pixel < images_.PixelsPerFrame(); ++pixel)
  {
    pixels += images_.IsLit(pixel);
  }
  // |e| bends as 1 / |e| where the error is e: by the mean error. Steps after
  // the first go by what pairs tell.
  const double bend = 2 * loss.l2 + (loss.l1 > 0 ? loss.l1 / std::max(loss_, 1.0 / 255) : 0);
  const double factor = (bend > 0 ? bend : 1) * slope_ / (pixels * static_cast<double>(frames_.size()));
  std::vector<float> energies(squares_.size());
  for (std::size_t i = 0; i < squares_.size(); ++i)
  {
    squares_[i] = static_cast<float>(squares_[i] * factor);
    const double r = state_.reflectivities[i];
    energies[i] = static_cast<float>(squares_[i] * r * r);
  }
  const double held = kRidge * Median(energies);
  ridge_.resize(squares_.size());
  for (std::size_t i = 0; i < squares_.size(); ++i)
  {
    const double r = state_.reflectivities[i];
    ridge_[i] = static_cast<float>(std::min(held / std::max(r * r, 1e-30), 1e30));
  }
}

/// B^-1 g with B = m C + ridge, C the integrals of dS/dc dS/dc^T under N(0,
/// 1/2).
QuasiNewton::Numbers QuasiNewton::TimesInverse(const Numbers& gradient) const
{
  Numbers out(gradient.size());
  ForBlocks(field_.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                const float* const g = &gradient[kNumbers * i];
                float* const to = &out[kNumbers * i];
                const double m = squares_[i], ridge = std::max<double>(ridge_[i], 1e-30);
                const double half = 1 / (0.5 * m + ridge), whole = 1 / (m + ridge);
                const double mean = (static_cast<double>(g[4]) + g[5] + g[6]) / 3;
                // (dr, sum E_kk / sqrt 3): [m + ridge, m sqrt3 / 2; m sqrt3 / 2, 5 m / 4
                // + ridge]
                const double a = m + ridge, b = 0.5 * std::sqrt(3.0) * m, c = 1.25 * m + ridge;
                const double sum = std::sqrt(3.0) * mean, determinant = a * c - b * b;
                const double dr = (c * g[0] - b * sum) / determinant, grown = (a * sum - b * g[0]) / determinant;
                to[0] = static_cast<float>(dr);
                for (std::size_t k = 0; k < 3; ++k)
                {
                  to[kShift + k] = static_cast<float>(half * g[kShift + k]);
                  to[kShape + k] = static_cast<float>(half * (g[kShape + k] - mean) + grown / std::sqrt(3.0));
                  to[kShape + 3 + k] = static_cast<float>(whole * g[kShape + 3 + k]);
                }
              }
            });
  return out;
}

/// Down the gradient, by the two loops over the pairs.
QuasiNewton::Numbers QuasiNewton::Direction() const
{
  Numbers direction = gradient_;
  std::vector<double> weights(pairs_.size());
  for (std::size_t k = pairs_.size(); k-- > 0;)
  {
    weights[k] = Dot(pairs_[k].step, direction) / pairs_[k].product;
    Add(direction, -weights[k], pairs_[k].change);
  }
  direction = TimesInverse(direction);
  const double scale = scale_ > 0 ? scale_ : kFirstScale;
  std::transform(direction.begin(), direction.end(), direction.begin(),
                 [scale](float c) { return static_cast<float>(-scale * c); });
  for (std::size_t k = 0; k < pairs_.size(); ++k)
  {
    const double weight = Dot(pairs_[k].change, direction) / pairs_[k].product;
    Add(direction, -weights[k] - weight, pairs_[k].step);
  }
  Limit(direction);
  ProjectClamped(direction, Of::Step);
  return direction;
}

/// No Gaussian changes by more than itself: |dr|, |r u| and |r E| are at most
/// |r|.
void QuasiNewton::Limit(Numbers& direction) const
{
  ForBlocks(field_.Size(),
            [&](std::size_t, std::size_t begin, std::size_t end)
            {
              for (std::size_t i = begin; i < end; ++i)
              {
                float* const own = &direction[kNumbers * i];
                const double most = std::abs(state_.reflectivities[i]);
                const auto bound = [most](float* first, double norm, std::size_t count)
                {
                  for (std::size_t k = 0; norm > most && k < count; ++k)
                  {
                    first[k] = static_cast<float>(first[k] * most / norm);
                  }
                };
                bound(own, most > 0 ? std::abs(own[0]) : 0, 1);
                bound(own + kShift, Eigen::Map<const Eigen::Vector3f>(own + kShift).cast<double>().norm(), 3);
                bound(own + kShape, ShapeOf(own).norm(), kElements.size());
              }
            });
}

/// The step from `before` to the present gradient, unless it says that the loss
/// bends down.
void QuasiNewton::Remember(const Numbers& step, const Numbers& before)
{
  Pair pair{step, gradient_, 0};
  Numbers old = before;
  ProjectClamped(old, Of::Gradient);
  Add(pair.change, -1, old);
  pair.product = Dot(pair.step, pair.change);
  if (pair.product <= 0)
  {
    return;
  }
  scale_ = pair.product / Dot(pair.change, TimesInverse(pair.change));
  if (pairs_.size() == kPairs)
  {
    pairs_.pop_front();
  }
  pairs_.push_back(std::move(pair));
}

}  // namespace bigus
