// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Numbers, arrays and texts as bytes, in this machine's order, and back with every check that a hostile file needs.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "Core/Model/Error.h"

namespace bigus
{

class StateWriter
{
public:
  template <class T>
  void Number(T value)
  {
    Numbers(&value, 1);
  }
  void Flag(bool value) { Number<std::uint8_t>(value); }

  /// `count` numbers that the reader knows the count of.
  template <class T>
  void Numbers(const T* values, std::size_t count)
  {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
  }

  template <class T>
  void Array(const std::vector<T>& values)
  {
    Number<std::uint64_t>(values.size());
    Numbers(values.data(), values.size());
  }

  void Text(std::string_view text)
  {
    Number<std::uint64_t>(text.size());
    bytes_.append(text);
  }

  /// Room for so many bytes more, for what is large.
  void Reserve(std::size_t bytes) { bytes_.reserve(bytes_.size() + bytes); }

  std::string Take() { return std::move(bytes_); }

private:
  std::string bytes_;
};

/// Reads what a StateWriter wrote. Nothing is allocated that the bytes left do not fill, and every floating-point number
/// is finite; else an Error says so. The bytes must outlive the reader.
class StateReader
{
public:
  explicit StateReader(std::string_view bytes) : left_(bytes) {}

  template <class T>
  T Number()
  {
    T value;
    Numbers(&value, 1);
    return value;
  }

  /// A number from `least` to `most`, ends included.
  template <class T>
  T NumberIn(T least, T most)
  {
    const T value = Number<T>();
    Require(value >= least && value <= most, "a number out of its range");
    return value;
  }

  bool Flag() { return NumberIn<std::uint8_t>(0, 1) != 0; }

  /// How many things of at least `bytesOfEach` bytes follow.
  std::size_t Count(std::size_t bytesOfEach)
  {
    const auto count = Number<std::uint64_t>();
    Require(count <= left_.size() / bytesOfEach, "more values than bytes");
    return static_cast<std::size_t>(count);
  }

  template <class T>
  void Numbers(T* values, std::size_t count)
  {
    static_assert(std::is_arithmetic_v<T>);
    Require(count <= left_.size() / sizeof(T), "less than was to be read");
    if (count > 0)
    {
      std::memcpy(values, left_.data(), count * sizeof(T));
    }
    left_.remove_prefix(count * sizeof(T));
    if constexpr (std::is_floating_point_v<T>)
    {
      for (std::size_t i = 0; i < count; ++i)
      {
        Require(std::isfinite(values[i]), "a number that is not finite");
      }
    }
  }

  template <class T>
  std::vector<T> Array()
  {
    std::vector<T> values(Count(sizeof(T)));
    Numbers(values.data(), values.size());
    return values;
  }

  /// The view is of the bytes that are read.
  std::string_view Text()
  {
    const std::size_t size = Count(1);
    const std::string_view text = left_.substr(0, size);
    left_.remove_prefix(size);
    return text;
  }

  std::size_t Left() const { return left_.size(); }
  /// Nothing may be left.
  void End() const { Require(left_.empty(), "more than was to be read"); }

  /// Throws Error with what was found.
  static void Require(bool isSound, const char* found)
  {
    if (!isSound)
    {
      throw Error(std::string("The state of the training is damaged: it holds ") + found + ".");
    }
  }

private:
  std::string_view left_;
};

}  // namespace bigus
