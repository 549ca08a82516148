// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// numpy arrays as Core's memory and back, and what the parts of the extension share.
#pragma once

#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Core/Model/SlicePlane.h"
#include "IO/FieldFile.h"

namespace nb = nanobind;
using namespace nb::literals;  // "name"_a

namespace bigus
{

using InputDoubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using InputFloats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using InputBytes = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;

inline bool IsAnyObject(PyObject*)
{
  return true;
}

/// What stubs call a numpy array.
class Array : public nb::object
{
public:
  NB_OBJECT_DEFAULT(Array, nb::object, "numpy.ndarray", IsAnyObject)
};

/// An array that shares memory with `owner`, which it keeps alive. Strides count elements; none: row by row.
template <class Element>
Array View(Element* data, std::initializer_list<std::size_t> shape, nb::handle owner,
           std::initializer_list<std::int64_t> strides = {})
{
  return nb::borrow<Array>(nb::cast(nb::ndarray<nb::numpy, Element>(data, shape, owner, strides)));
}

/// An array that owns the elements.
template <class Element>
Array Owned(std::vector<Element> elements, std::initializer_list<std::size_t> shape)
{
  auto* kept = new std::vector<Element>(std::move(elements));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<Element>*>(p); });
  return nb::borrow<Array>(nb::cast(nb::ndarray<nb::numpy, Element>(kept->data(), shape, owner)));
}

/// The same of one axis.
template <class Element>
Array Owned(std::vector<Element> elements)
{
  const std::size_t count = elements.size();
  return Owned(std::move(elements), {count});
}

/// An array whose elements `fill(first)` puts one after the other, while other threads of Python run.
template <class Element, class Fill>
Array Filled(std::initializer_list<std::size_t> shape, const Fill& fill)
{
  std::vector<Element> elements(std::accumulate(shape.begin(), shape.end(), std::size_t(1), std::multiplies<>()));
  {
    const nb::gil_scoped_release others;
    fill(elements.data());
  }
  return Owned(std::move(elements), shape);
}

/// The picture [height, width] that `draw(plane, pixels)` makes of a plane, while other threads of Python run.
template <class Pixel, class Draw>
Array PictureAt(const Eigen::Matrix4d& imageToWorld, int width, int height, const Draw& draw)
{
  const SlicePlane plane = SlicePlane::FromImageToReference(imageToWorld, width, height);
  plane.Validate("slice plane");
  return Filled<Pixel>({static_cast<std::size_t>(height), static_cast<std::size_t>(width)},
                       [&](Pixel* pixels) { draw(plane, pixels); });
}

inline void Put(nb::dict&) {}
template <class Value, class... More>
void Put(nb::dict& dict, const char* name, Value&& value, More&&... more)
{
  dict[name] = std::forward<Value>(value);
  Put(dict, std::forward<More>(more)...);
}

/// A dictionary of names and values, given one after the other.
template <class... Entries>
nb::dict Dict(Entries&&... entries)
{
  nb::dict dict;
  Put(dict, std::forward<Entries>(entries)...);
  return dict;
}

/// Throws ValueError unless the array has this shape; -1 stands for any number.
template <class Array>
void RequireShape(const Array& array, std::initializer_list<std::int64_t> shape, const std::string& what)
{
  bool isRight = array.ndim() == shape.size();
  std::string wanted, found;
  std::size_t axis = 0;
  for (const std::int64_t size : shape)
  {
    isRight = isRight && (size < 0 || array.shape(axis) == static_cast<std::size_t>(size));
    wanted += (axis++ ? ", " : "") + (size < 0 ? std::string("n") : std::to_string(size));
  }
  for (std::size_t k = 0; k < array.ndim(); ++k)
  {
    found += (k ? ", " : "") + std::to_string(array.shape(k));
  }
  if (!isRight)
  {
    throw nb::value_error((what + " must be of shape (" + wanted + "), not (" + found + ")").c_str());
  }
}

inline Eigen::Matrix4d MatrixAt(const double* rowMajor)
{
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rowMajor);
}

/// The numbers of matrices, one after the other.
inline std::vector<double> RowByRow(const std::vector<Eigen::Matrix4d>& matrices)
{
  std::vector<double> numbers;
  for (const Eigen::Matrix4d& matrix : matrices)
  {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = matrix;
    numbers.insert(numbers.end(), rows.data(), rows.data() + 16);
  }
  return numbers;
}

/// Text of a file, of which bytes may be wrong: Python's text must be UTF-8.
inline nb::str ToText(const std::string& text)
{
  return nb::steal<nb::str>(PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace"));
}

inline nb::list ToTexts(const std::vector<std::string>& lines)
{
  nb::list texts;
  for (const std::string& line : lines)
  {
    texts.append(ToText(line));
  }
  return texts;
}

using Field = StoredField;  // as Python has it

/// The field without digits that no picture shows.
Field Rounded(Field field);

/// [n, 4, 4] of matrices.
Array PosesToArray(const std::vector<Eigen::Matrix4d>& poses);

void BindSweep(nb::module_& m);
void BindField(nb::module_& m);
void BindFiles(nb::module_& m);
void BindTraining(nb::module_& m);
void BindSlices(nb::module_& m);
void BindPhantom(nb::module_& m);

/// What other wings link into the extension is bound when it is loaded. To be called before that, by what is initialized
/// with the library; returns how many there are. Who brings a filter of VTK's pipelines puts it into the module's
/// `added_filters`, by the name of the Python module that has it.
std::size_t AddBinding(void (*bind)(nb::module_&));

}  // namespace bigus
