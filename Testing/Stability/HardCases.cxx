// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Stability/HardCases.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <set>

namespace bigus::test
{
namespace
{

Eigen::Matrix<Long, 3, 3> LongRotation(const Eigen::Vector4d& wxyz)
{
  Eigen::Matrix<Long, 4, 1> q = wxyz.cast<Long>() / Long(wxyz.cwiseAbs().maxCoeff());
  q /= q.norm();
  return Eigen::Quaternion<Long>(q[0], q[1], q[2], q[3]).toRotationMatrix();
}

/// The middle of the field's bounding box, which engines put their origin at.
Eigen::Vector3d Middle(const GaussianField& field)
{
  Eigen::Vector3d low = field.means[0], high = field.means[0];
  for (const Eigen::Vector3d& mean : field.means)
  {
    low = low.cwiseMin(mean);
    high = high.cwiseMax(mean);
  }
  return (low + high) / 2;
}

struct Result
{
  double number;
  std::optional<double> ofBound;  // none: the number is only stated
  std::size_t nonFinite;
};

/// A line of the table: one case, with a result for each engine.
struct Row
{
  std::string group, name;
  std::map<std::string, Result> results;
};

std::vector<Row>& Rows()
{
  static std::vector<Row> rows;
  return rows;
}

void AddRow(const std::string& group, const std::string& name, const std::string& engine, const Result& result)
{
  const auto found = std::find_if(Rows().begin(), Rows().end(),
                                  [&](const Row& row) { return row.group == group && row.name == name; });
  Row& row = found == Rows().end() ? Rows().emplace_back(Row{group, name, {}}) : *found;
  row.results[engine] = result;
}

class PrintTable : public ::testing::Environment
{
public:
  void TearDown() override
  {
    if (Rows().empty())
    {
      return;
    }
    std::set<std::string> engines;
    for (const Row& row : Rows())
    {
      for (const auto& [engine, result] : row.results)
      {
        engines.insert(engine);
      }
    }
    std::string title = "| | case |", line = "|---|---|";
    for (const std::string& engine : engines)
    {
      title += " " + engine + ": error | of its bound |";
      line += "---|---|";
    }
    std::printf("\n%s not finite |\n%s---|\n", title.c_str(), line.c_str());
    for (const Row& row : Rows())
    {
      std::printf("| %s | %s |", row.group.c_str(), row.name.c_str());
      std::size_t nonFinite = 0;
      for (const std::string& engine : engines)
      {
        const auto found = row.results.find(engine);
        if (found == row.results.end())
        {
          std::printf(" | |");
          continue;
        }
        nonFinite += found->second.nonFinite;
        std::printf(" %.2g |", found->second.number);
        std::printf(found->second.ofBound ? " %.2g |" : " |", found->second.ofBound.value_or(0));
      }
      std::printf(" %zu |\n", nonFinite);
    }
    std::fflush(stdout);
  }
};

const ::testing::Environment* const kPrintTable = ::testing::AddGlobalTestEnvironment(new PrintTable);

}  // namespace

ExactSplat::ExactSplat(const GaussianField& field, std::size_t i, const SlicePlane& plane)
{
  const LongVector a = plane.columnStep.cast<Long>(), b = plane.rowStep.cast<Long>();
  const LongVector n = a.cross(b).normalized();
  const LongVector s = field.scales[i].cast<Long>();
  const LongVector toPlane = plane.origin.cast<Long>() - field.means[i].cast<Long>();
  const Eigen::Matrix<Long, 3, 3> toLocal = LongRotation(field.rotations[i]).transpose();
  const auto whiten = [&](const LongVector& v) -> LongVector { return (toLocal * v).cwiseQuotient(s); };
  atOrigin_ = whiten(toPlane);
  perColumn_ = whiten(a);
  perRow_ = whiten(b);
  perMillimetre_ = whiten(n);
  variance_ = Long(field.beam.elevationSigma) * Long(field.beam.elevationSigma);
  n_ = 1 + variance_ * perMillimetre_.squaredNorm();
  const Long t = (toLocal * n).cwiseProduct(s).squaredNorm() + variance_;
  const Long distance = n.dot(toPlane);
  peak_ = std::exp(-distance * distance / (2 * t)) / std::sqrt(n_);
}

Long ExactSplat::Weight(Long column, Long row) const
{
  const LongVector y = atOrigin_ + column * perColumn_ + row * perRow_;
  const Long shift = -y.dot(perMillimetre_) / n_;  // z* / sigma_E^2
  const LongVector closest = y + variance_ * shift * perMillimetre_;
  const Long exponent = (closest.squaredNorm() + variance_ * shift * shift) / 2;
  return exponent < 100 ? std::exp(-exponent) / std::sqrt(n_) : 0;  // exp(-100) = 4e-44
}

std::vector<ExactSplat> ExactSplats(const GaussianField& field, const SlicePlane& plane)
{
  std::vector<ExactSplat> splats;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    splats.emplace_back(field, i, plane);
  }
  return splats;
}

void PlaceInView(GaussianField& field, std::size_t i, const SlicePlane& plane, double column, double row,
                 const Eigen::Vector2d& eta, double rho)
{
  // Sigma' = T Sigma T^T in pixel, pixel, mm; the footprint's covariance is B = Sigma'_uv - h h^T / t and its
  // centre m = mu'_uv - h mu'_z / t.
  Eigen::Matrix<Long, 3, 3> basis;
  const LongVector a = plane.columnStep.cast<Long>(), b = plane.rowStep.cast<Long>();
  basis << a, b, a.cross(b).normalized();
  const Eigen::Matrix<Long, 3, 3> factor =
      basis.inverse() * LongRotation(field.rotations[i]) * field.scales[i].cast<Long>().asDiagonal();
  const Eigen::Matrix<Long, 3, 3> sigma = factor * factor.transpose();
  const Long elevation = field.beam.elevationSigma;
  const Long t = sigma(2, 2) + elevation * elevation;
  const Eigen::Matrix<Long, 2, 1> h = sigma.block<2, 1>(0, 2);
  const Eigen::Matrix<Long, 2, 2> footprint = sigma.block<2, 2>(0, 0) - h * h.transpose() / t;
  const Long c11 = std::sqrt(footprint(0, 0)), c21 = footprint(1, 0) / c11;
  const Long c22 = std::sqrt(std::max(footprint(1, 1) - c21 * c21, Long(0)));
  const Long z = rho * std::sqrt(t);
  const LongVector centre(column - c11 * eta[0] + h[0] * z / t, row - c21 * eta[0] - c22 * eta[1] + h[1] * z / t, z);
  field.means[i] = (plane.origin.cast<Long>() + basis * centre).cast<double>();
}

double Displacement(const GaussianField& field, std::size_t i, const SlicePlane& plane, double u)
{
  const Eigen::Vector3d middle = Middle(field);
  const Eigen::Vector3d corners[4] = {plane.Point(0, 0), plane.Point(plane.width - 1, 0),
                                      plane.Point(0, plane.height - 1), plane.Point(plane.width - 1, plane.height - 1)};
  double extent = (field.means[i] - middle).norm(), own = field.means[i].norm();
  for (const Eigen::Vector3d& corner : corners)
  {
    extent = std::max({extent, (corner - middle).norm(), (corner - field.means[i]).norm()});
    own = std::max(own, corner.norm());
  }
  const double thinnest = field.scales[i].minCoeff(), sigma = field.beam.elevationSigma;
  const double aspect = field.scales[i].maxCoeff() / thinnest;
  const double skew = plane.columnStep.norm() * plane.rowStep.norm() / plane.columnStep.cross(plane.rowStep).norm();
  return 32 * u * skew * (aspect + (extent + sigma) / thinnest) + 32 * 0x1p-53 * own / thinnest;
}

double SplatErrorAt(const ExactSplat& splat, Long w, double displacement, double u)
{
  const Long peak = splat.PeakOfAllPlanes();
  const Long q = std::sqrt(2 * std::log(peak / std::max(w, std::numeric_limits<Long>::min())));
  const Long nearer = std::max(q - displacement, Long(0));
  const Long moved = peak * std::exp(-nearer * nearer / 2) - w + (FlatError(u) + displacement) * w;
  return static_cast<double>(std::min(moved, peak));
}

double SplatErrorBound(const GaussianField& field, std::size_t i, const SlicePlane& plane, double u)
{
  return std::min(FlatError(u) + Displacement(field, i, plane, u), 1.0) *
         static_cast<double>(ExactSplat(field, i, plane).PeakOfAllPlanes());
}

void Conclude(const std::string& group, const std::string& name, const std::string& engine, double error,
              double ofBound, std::size_t nonFinite)
{
  EXPECT_EQ(nonFinite, 0u) << group << ", " << name;
  EXPECT_LE(ofBound, 1.0) << group << ", " << name << ": the error, " << error << ", is " << ofBound
                          << " times what it may be";
  AddRow(group, name, engine, {error, ofBound, nonFinite});
}

void ConcludeFinite(const std::string& group, const std::string& name, const std::string& engine, double number,
                    std::size_t nonFinite)
{
  EXPECT_EQ(nonFinite, 0u) << group << ", " << name;
  AddRow(group, name, engine, {number, std::nullopt, nonFinite});
}

std::size_t CountNonFinite(const std::vector<float>& values)
{
  return std::count_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); });
}

std::size_t CountNonFinite(const FieldGradient& gradient)
{
  std::size_t count = 0;
  for (std::size_t i = 0; i < gradient.means.size(); ++i)
  {
    count += !gradient.means[i].allFinite() + !gradient.logScales[i].allFinite() + !gradient.rotations[i].allFinite() +
             !std::isfinite(gradient.reflectivities[i]);
  }
  return count;
}

std::size_t CountNonFinite(const GaussianField& field)
{
  std::size_t count = 0;
  for (std::size_t i = 0; i < field.Size(); ++i)
  {
    count += !field.means[i].allFinite() + !field.scales[i].allFinite() + !field.rotations[i].allFinite() +
             !std::isfinite(field.reflectivities[i]);
  }
  return count;
}

RenderedPlane RenderWhole(Engine& engine, const SlicePlane& plane, ViewOutput output)
{
  RenderedPlane image;
  image.values.assign(plane.NumberOfPixels(), std::nanf(""));  // a pixel left unwritten must show
  image.coverage = image.values;
  engine.Render(plane, output, image.values.data(), image.coverage.data());
  return image;
}

SlicePlane FlatPlane(int width, int height, double columnSpacing, double rowSpacing)
{
  SlicePlane plane;
  plane.columnStep = {columnSpacing, 0, 0};
  plane.rowStep = {0, rowSpacing, 0};
  plane.width = width;
  plane.height = height;
  plane.origin = {-0.5 * (width - 1) * columnSpacing, -0.5 * (height - 1) * rowSpacing, 0};
  return plane;
}

}  // namespace bigus::test
