// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields whose arrays numpy sees without copies.
#include "Arrays.h"
#include "Core/Model/FieldChunks.h"
#include "Core/Model/FieldRounding.h"
#include "Core/Model/FieldTransform.h"
#include "Data/FieldShape.h"

namespace bigus
{
namespace
{

/// A view of vectors that lie one after another; they stay where they are, since a field's size does not change.
template <int Rows>
Array RowsOf(nb::handle self, std::vector<Eigen::Matrix<double, Rows, 1>> GaussianField::*member)
{
  auto& vectors = nb::cast<Field&>(self).*member;
  static_assert(sizeof(vectors[0]) == Rows * sizeof(double), "numpy sees them as one array");
  return View(reinterpret_cast<double*>(vectors.data()), {vectors.size(), std::size_t(Rows)}, self);
}

template <int Rows>
void Copy(const InputDoubles& from, std::vector<Eigen::Matrix<double, Rows, 1>>& to)
{
  for (std::size_t i = 0; i < to.size(); ++i)
  {
    to[i] = Eigen::Map<const Eigen::Matrix<double, Rows, 1>>(from.data() + Rows * i);
  }
}

Field Make(const InputDoubles& centers, const InputDoubles& scales, const InputDoubles& rotations,
           const InputDoubles& reflectivities, double gamma, double elevationSigma, double probeElevationSigma,
           const InputDoubles& normals)
{
  RequireShape(centers, {-1, 3}, "centers");
  const auto n = static_cast<std::int64_t>(centers.shape(0));
  RequireShape(scales, {n, 3}, "scales");
  RequireShape(rotations, {n, 4}, "rotations");
  RequireShape(reflectivities, {n}, "reflectivities");
  RequireShape(normals, {-1, 3}, "trained_normals");
  Field field;
  field.Resize(static_cast<std::size_t>(n));
  Copy(centers, field.means);
  Copy(scales, field.scales);
  Copy(rotations, field.rotations);
  field.reflectivities.assign(reflectivities.data(), reflectivities.data() + n);
  field.transfer.gamma = gamma;
  field.beam.elevationSigma = elevationSigma;
  field.beam.probeElevationSigma = probeElevationSigma;
  field.beam.trainedNormals.resize(normals.shape(0));
  Copy(normals, field.beam.trainedNormals);
  field.Validate();
  return field;
}

}  // namespace

void BindField(nb::module_& m)
{
  nb::class_<Field>(m, "Field",
                    "Signed Gaussians in space: r exp(-1/2 (x - mu)^T Sigma^-1 (x - mu)), Sigma = R diag(s)^2 "
                    "R^T. The arrays are views: what is written to them changes the field, and using a field "
                    "checks it. They keep it alive.")
      .def(nb::init<>())
      .def_static("make", &Make, nb::arg("centers"), nb::arg("scales"), nb::arg("rotations"), nb::arg("reflectivities"),
                  nb::arg("gamma"), nb::arg("elevation_sigma"), nb::arg("probe_elevation_sigma"),
                  nb::arg("trained_normals"), "What bigus.field() calls, with every argument.")
      .def_prop_ro(
          "centers", [](nb::handle self) { return RowsOf(self, &GaussianField::means); },
          "mu: float64 [n, 3], mm, world frame.")
      .def_prop_ro(
          "scales", [](nb::handle self) { return RowsOf(self, &GaussianField::scales); },
          "s: float64 [n, 3], standard deviations along the Gaussian's own axes, mm, above 0.")
      .def_prop_ro(
          "rotations", [](nb::handle self) { return RowsOf(self, &GaussianField::rotations); },
          "Quaternions w, x, y, z: float64 [n, 4], of any length but 0.")
      .def_prop_ro(
          "reflectivities",
          [](nb::handle self)
          {
            auto& r = nb::cast<Field&>(self).reflectivities;
            return View(r.data(), {r.size()}, self);
          },
          "r: float64 [n], signed.")
      .def_prop_rw(
          "gamma", [](const Field& f) { return f.transfer.gamma; },
          [](Field& f, double value) { f.transfer.gamma = value; },
          "Of the display I = 1 - exp(-gamma max(S, 0)); above 0.")
      .def_prop_rw(
          "elevation_sigma", [](const Field& f) { return f.beam.elevationSigma; },
          [](Field& f, double value) { f.beam.elevationSigma = value; },
          "Thickness of the planes trained on, standard deviation, mm; 0 is a thin plane.")
      .def_prop_rw(
          "probe_elevation_sigma", [](const Field& f) { return f.beam.probeElevationSigma; },
          [](Field& f, double value) { f.beam.probeElevationSigma = value; },
          "Thickness of the probe's beam, standard deviation, mm; 0 where it is not known.")
      .def_prop_ro(
          "trained_normals",
          [](nb::handle self)
          {
            auto& normals = nb::cast<Field&>(self).beam.trainedNormals;
            return View(reinterpret_cast<double*>(normals.data()), {normals.size(), 3}, self);
          },
          "Unit normals that stand for the planes trained on: float64 [k, 3].")
      .def_prop_rw(
          "provenance", [](const Field& f) { return ToTexts(f.provenance); },
          [](Field& f, std::vector<std::string> lines) { f.provenance = std::move(lines); },
          "Where the field comes from: a list of lines key=value, which files keep. Set it as a whole.")
      .def_prop_rw(
          "kept_error", [](const Field& f) { return nb::bytes(f.standardError.data(), f.standardError.size()); },
          [](Field& f, const nb::bytes& kept) { f.standardError.assign(kept.c_str(), kept.size()); },
          "What bigus.standard_error rests on, as training leaves it: bytes, which .vtp files keep; empty: nothing.")
      .def(
          "validate", [](const Field& field) { field.Validate(); },
          "Raises Error naming the array, the index and the value, unless all is sound.")
      .def(
          "transformed",
          [](const Field& field, const InputDoubles& matrix)
          {
            RequireShape(matrix, {4, 4}, "the transform");
            return Field(Transformed(field, MatrixAt(matrix.data())), field.provenance);
          },
          nb::arg("matrix"),
          "The field in other coordinates: matrix, float64 [4, 4], turns, mirrors, scales evenly and moves (mm). Raises "
          "Error for one that does anything else.")
      .def(
          "part",
          [](const Field& field, int total, int piece, int pieces)
          {
            RequirePartition(total, piece, pieces);
            FieldChunks chunks = ChunksOfPiece(total, piece, pieces);
            Field part(PartOf(field, chunks), field.provenance);
            return nb::make_tuple(std::move(part), chunks.first, chunks.sizes);
          },
          nb::arg("chunks"), nb::arg("piece"), nb::arg("pieces"),
          "One process's part of the field, split into so many chunks: (field, its first chunk, Gaussians of each chunk).")
      .def(
          "rounded",
          [](Field field)
          {
            RoundField(field);
            return field;
          },
          "The field without digits that no picture shows, as files have it.")
      .def("__len__", [](const Field& field) { return field.Size(); })
      .def("__copy__", [](const Field& field) { return Field(field); })
      .def(
          "__deepcopy__", [](const Field& field, nb::handle) { return Field(field); }, nb::arg("memo"))
      .def("__repr__",
           [](const Field& field) { return "<bigus.Field of " + std::to_string(field.Size()) + " Gaussians>"; });
  m.def(
      "transform_text",
      [](const std::string& before, const InputDoubles& matrix)
      { return TransformText(before, MatrixAt(matrix.data())); },
      nb::arg("before"), nb::arg("matrix"));
  m.def("refuse_transform", &RefuseTransform, nb::arg("property"), nb::arg("kind"), nb::arg("what"));
  // What VTK's arrays must be, for vtkdata.py; shapes are (components, tuples).
  using Shape = std::pair<int, std::int64_t>;
  m.attr("format_version") = kFieldFormatVersion;
  m.def("require_format_version", &RequireFieldFormatVersion, nb::arg("owner"), nb::arg("version"));
  m.def("require_few_normals", &RequireFewTrainedNormals, nb::arg("owner"), nb::arg("normals"));
  m.def(
      "require_array",
      [](const std::string& owner, const std::string& name, const std::optional<Shape>& found, const Shape& needed)
      {
        if (!found)
        {
          throw MissingArray(owner, name, needed.first, needed.second);
        }
        RequireArrayShape(owner, name, found->first, found->second, needed.first, needed.second);
      },
      nb::arg("owner"), nb::arg("name"), nb::arg("found").none(), nb::arg("needed"));
}

}  // namespace bigus
