// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Gaussian fields whose arrays numpy sees without copies.
#include <array>

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
template <class Vectors>
Array RowsOf(Vectors& vectors, nb::handle self)
{
  constexpr std::size_t kRows = Vectors::value_type::RowsAtCompileTime;
  static_assert(sizeof(vectors[0]) == kRows * sizeof(double), "numpy sees them as one array");
  return View(reinterpret_cast<double*>(vectors.data()), {vectors.size(), kRows}, self);
}

template <auto Member>
Array ArrayOf(nb::handle self)
{
  return RowsOf(nb::cast<Field&>(self).field.*Member, self);
}

template <int Rows>
void Copy(const InputDoubles& from, std::vector<Eigen::Matrix<double, Rows, 1>>& to)
{
  to.resize(from.shape(0));
  for (std::size_t i = 0; i < to.size(); ++i)
  {
    to[i] = Eigen::Map<const Eigen::Matrix<double, Rows, 1>>(from.data() + Rows * i);
  }
}

template <class Rows>
Array Stacked(const Rows& rows, std::size_t columns)
{
  std::vector<double> numbers;
  for (const auto& row : rows)
  {
    numbers.insert(numbers.end(), row.data(), row.data() + columns);
  }
  return Owned(std::move(numbers), {rows.size(), columns});
}

/// ViewTerm [n, 3], ViewMean [1, 9], ViewSteps [1, 3] and ViewPoses [k, 16], as Data/FieldData.h has them.
using ViewArrays = std::tuple<InputDoubles, InputDoubles, InputDoubles, InputDoubles>;

nb::object ViewOf(const Field& field)
{
  if (!field.view)
  {
    return nb::none();
  }
  const RecordedViews& views = field.view->views;
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> mean = views.mean;
  return nb::make_tuple(Stacked(field.view->terms, 3), Owned(std::vector<double>(mean.data(), mean.data() + 9), {1, 9}),
                        Owned(std::vector<double>{views.unit, views.angleStep, views.elevationStep}, {1, 3}),
                        Owned(RowByRow(views.poses), {views.poses.size(), 16}));
}

void SetView(Field& field, const std::optional<ViewArrays>& given)
{
  std::optional<ViewDependence> view;
  if (given)
  {
    const auto& [terms, mean, steps, poses] = *given;
    RequireShape(terms, {static_cast<std::int64_t>(field.field.Size()), 3}, "ViewTerm");
    RequireShape(mean, {1, 9}, "ViewMean");
    RequireShape(steps, {1, 3}, "ViewSteps");
    RequireShape(poses, {-1, 16}, "ViewPoses");
    const auto rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mean.data());
    view = ViewDependence{{rotation, steps.data()[0], steps.data()[1], steps.data()[2], {}},
                          std::vector<Eigen::Vector3d>(field.field.Size())};
    Copy(terms, view->terms);
    for (std::size_t k = 0; k < poses.shape(0); ++k)
    {
      view->views.poses.push_back(MatrixAt(poses.data() + 16 * k));
    }
    view->Validate(field.field.Size());
  }
  field.view = std::move(view);
}

/// LabelNames, LabelValues [k], LabelColors [k, 3], weights [n + m, k] and LabelPoints [m, 4], as Data/LabelData.h has them.
using LabelArrays = std::tuple<std::vector<std::string>, InputDoubles, InputDoubles, InputDoubles, InputDoubles>;

nb::object LabelsOf(const Field& field)
{
  if (!field.labels)
  {
    return nb::none();
  }
  const FieldLabels& all = *field.labels;
  std::vector<std::string> names;
  std::vector<double> values;
  std::vector<std::array<double, 3>> colors;
  for (const Label& label : all.labels)
  {
    names.push_back(label.name);
    values.push_back(label.value);
    colors.push_back(label.color);
  }
  const std::size_t count = names.size();
  return nb::make_tuple(ToTexts(names), Owned(std::move(values), {count}), Stacked(colors, 3),
                        Owned(all.weights, {field.field.Size() + all.points.size(), count}), Stacked(all.points, 4));
}

void SetLabels(Field& field, const std::optional<LabelArrays>& given)
{
  std::optional<FieldLabels> labels;
  if (given)
  {
    const auto& [names, values, colors, weights, points] = *given;
    const auto count = static_cast<std::int64_t>(names.size());
    RequireShape(values, {count}, "LabelValues");
    RequireShape(colors, {count, 3}, "LabelColors");
    RequireShape(points, {-1, 4}, "LabelPoints");
    RequireShape(weights, {static_cast<std::int64_t>(field.field.Size() + points.shape(0)), count}, "LabelWeight");
    labels.emplace();
    for (std::size_t k = 0; k < names.size(); ++k)
    {
      const double value = values.data()[k], *const c = colors.data() + 3 * k;
      const bool isInt = value >= 0 && value <= kLargestLabel;
      labels->labels.push_back({isInt ? static_cast<int>(value) : -1, names[k], {c[0], c[1], c[2]}});
    }
    labels->weights.assign(weights.data(), weights.data() + weights.size());
    Copy(points, labels->points);
    labels->Validate(field.field.Size());
  }
  field.labels = std::move(labels);
}

Field Moved(const Field& field, const Eigen::Matrix4d& transform)
{
  const auto moved = [&transform](const auto& part)
  { return part ? std::optional(Transformed(*part, transform)) : std::nullopt; };
  return {Transformed(field.field, transform), field.provenance, {}, {}, moved(field.view), moved(field.labels)};
}

/// One process's part: (field, its first chunk, Gaussians of each chunk).
nb::tuple Part(const Field& field, int total, int piece, int pieces)
{
  RequirePartition(total, piece, pieces);
  FieldChunks chunks = ChunksOfPiece(total, piece, pieces);
  Field part{PartOf(field.field, chunks), field.provenance, {}};
  part.view = field.view ? std::optional(PartOf(*field.view, chunks)) : std::nullopt;
  return nb::make_tuple(std::move(part), chunks.first, chunks.sizes);
}

std::map<int, std::string> NamesOfLabels(const Field& field)
{
  std::map<int, std::string> names;
  for (const Label& label : field.labels ? field.labels->labels : std::vector<Label>())
  {
    names[label.value] = label.name;
  }
  return names;
}

/// What VTK's array must be, for vtkdata.py; shapes are (components, tuples).
void RequireArray(const std::string& owner, const std::string& name,
                  const std::optional<std::pair<int, std::int64_t>>& found, const std::pair<int, std::int64_t>& needed)
{
  if (!found)
  {
    throw MissingArray(owner, name, needed.first, needed.second);
  }
  RequireArrayShape(owner, name, found->first, found->second, needed.first, needed.second);
}

}  // namespace

Field Rounded(Field field)
{
  RoundField(field.field);
  if (field.view)
  {
    RoundView(*field.view);
  }
  return field;
}

void BindField(nb::module_& m)
{
  nb::class_<Field>(m, "Field",
                    "Signed Gaussians in space: r exp(-1/2 (x - mu)^T Sigma^-1 (x - mu)), Sigma = R diag(s)^2 "
                    "R^T. The arrays are views: what is written to them changes the field, and using a field "
                    "checks it. They keep it alive.")
      .def(
          "__init__",
          [](Field* self, std::size_t gaussians, std::size_t normals)
          {
            new (self) Field();
            self->field.Resize(gaussians);
            self->field.beam.trainedNormals.resize(normals);
          },
          "gaussians"_a = 0, "trained_normals"_a = 0, "So many of each, for bigus.field() to fill.")
      .def_prop_ro("centers", &ArrayOf<&GaussianField::means>, "mu: float64 [n, 3], mm, world frame.")
      .def_prop_ro("scales", &ArrayOf<&GaussianField::scales>,
                   "s: float64 [n, 3], standard deviations along the Gaussian's own axes, mm, above 0.")
      .def_prop_ro("rotations", &ArrayOf<&GaussianField::rotations>,
                   "Quaternions w, x, y, z: float64 [n, 4], of any length but 0.")
      .def_prop_ro(
          "reflectivities",
          [](nb::handle self)
          {
            auto& r = nb::cast<Field&>(self).field.reflectivities;
            return View(r.data(), {r.size()}, self);
          },
          "r: float64 [n], signed.")
      .def_prop_rw(
          "gamma", [](const Field& f) { return f.field.transfer.gamma; },
          [](Field& f, double value) { f.field.transfer.gamma = value; },
          "Of the display I = 1 - exp(-gamma max(S, 0)); above 0.")
      .def_prop_rw(
          "elevation_sigma", [](const Field& f) { return f.field.beam.elevationSigma; },
          [](Field& f, double value) { f.field.beam.elevationSigma = value; },
          "Thickness of the planes trained on, standard deviation, mm; 0 is a thin plane.")
      .def_prop_rw(
          "probe_elevation_sigma", [](const Field& f) { return f.field.beam.probeElevationSigma; },
          [](Field& f, double value) { f.field.beam.probeElevationSigma = value; },
          "Thickness of the probe's beam, standard deviation, mm; 0 where it is not known.")
      .def_prop_ro(
          "trained_normals",
          [](nb::handle self) { return RowsOf(nb::cast<Field&>(self).field.beam.trainedNormals, self); },
          "Unit normals that stand for the planes trained on: float64 [k, 3].")
      .def_prop_rw(
          "provenance", [](const Field& f) { return ToTexts(f.provenance); },
          [](Field& f, std::vector<std::string> lines) { f.provenance = std::move(lines); },
          "Where the field comes from: a list of lines key=value, which files keep. Set it as a whole.")
      .def_prop_rw(
          "kept_error", [](const Field& f) { return nb::bytes(f.standardError.data(), f.standardError.size()); },
          [](Field& f, const nb::bytes& kept) { f.standardError.assign(kept.c_str(), kept.size()); },
          "What bigus.standard_error rests on, as training leaves it: bytes, which .vtp files keep; empty: nothing.")
      .def_prop_ro("labels", &NamesOfLabels,
                   "Names of the labels that bigus.label gave it, by their values; empty: none.")
      .def_prop_rw("view_arrays", &ViewOf, &SetView, nb::arg().none())
      .def_prop_rw("label_arrays", &LabelsOf, &SetLabels, nb::arg().none())
      .def(
          "validate", [](const Field& f) { f.field.Validate(); },
          "Raises Error naming the array, the index and the value, unless all is sound.")
      .def(
          "transformed", &Moved, "matrix"_a,
          "The field in other coordinates: matrix, float64 [4, 4], turns, mirrors, scales evenly and moves (mm). Raises "
          "Error for one that does anything else.")
      .def("part", &Part, "chunks"_a, "piece"_a, "pieces"_a,
           "One process's part of the field, split into so many chunks: (field, its first chunk, Gaussians of each "
           "chunk).")
      .def("rounded", &Rounded, "The field without digits that no picture shows, as files have it.")
      .def("__len__", [](const Field& f) { return f.field.Size(); })
      .def("__copy__", [](const Field& f) { return f; })
      .def(
          "__deepcopy__", [](const Field& f, nb::handle) { return f; }, "memo"_a)
      .def("__repr__",
           [](const Field& f) { return "<bigus.Field of " + std::to_string(f.field.Size()) + " Gaussians>"; });
  m.def("transform_text", &TransformText, "before"_a, "matrix"_a);
  m.def("refuse_transform", &RefuseTransform, "property"_a, "kind"_a, "what"_a);
  m.attr("format_version") = kFieldFormatVersion;
  m.attr("view_version") = kViewVersion;
  m.def("require_format_version", &RequireFieldFormatVersion, "owner"_a, "version"_a);
  m.def("require_view_version", &RequireViewVersion, "owner"_a, "version"_a);
  m.def("require_few_normals", &RequireFewTrainedNormals, "owner"_a, "normals"_a);
  m.def("require_array", &RequireArray, "owner"_a, "name"_a, "found"_a.none(), "needed"_a);
}

}  // namespace bigus
