// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What shape the arrays of a field have, for whoever takes one apart or puts one together, with VTK or without.
#pragma once

#include <cstdint>
#include <sstream>
#include <string>

#include "Core/Model/Error.h"

namespace bigus
{

/// The one version of the format of fields that there is.
inline constexpr int kFieldFormatVersion = 1;

/// The one version of what fields know of directions.
inline constexpr int kViewVersion = 1;

/// Directions in which space can be seen, five degrees apart, are some thousand; more would only take time.
inline constexpr std::int64_t kMostTrainedNormals = 10000;

/// An array that is not there. `owner` begins the message.
inline Error MissingArray(const std::string& owner, const std::string& name, int components, std::int64_t tuples)
{
  return Error(owner + ": the array " + name + " is missing; it needs " + std::to_string(tuples) + " tuples of " +
               std::to_string(components) + ".");
}

/// Throws Error unless the array has the shape that it needs.
inline void RequireArrayShape(const std::string& owner, const std::string& name, std::int64_t foundComponents,
                              std::int64_t foundTuples, int components, std::int64_t tuples)
{
  Require(foundComponents == components && foundTuples == tuples, owner, ": the array ", name, " has ", foundTuples,
          " tuples of ", foundComponents, "; expected ", tuples, " of ", components, ".");
}

/// Throws Error unless this program reads fields of that version.
inline void RequireFieldFormatVersion(const std::string& owner, double version)
{
  if (version != kFieldFormatVersion)
  {
    std::ostringstream number;
    number << version;
    throw Error(owner + ": FormatVersion is " + number.str() + ", a version that this program cannot read (it reads " +
                std::to_string(kFieldFormatVersion) + "); a newer BIGUS is needed.");
  }
}

/// Throws Error unless this program reads what a field of that version knows of directions.
inline void RequireViewVersion(const std::string& owner, double version)
{
  if (version != kViewVersion)
  {
    std::ostringstream number;
    number << version;
    throw Error(owner + ": ViewVersion is " + number.str() + ", a version that this program cannot read (it reads " +
                std::to_string(kViewVersion) + "); a newer BIGUS is needed, or a field without the array ViewTerm.");
  }
}

/// Throws Error where a field has more trained normals than are read.
inline void RequireFewTrainedNormals(const std::string& owner, std::int64_t normals)
{
  Require(normals <= kMostTrainedNormals, owner, ": TrainedNormals holds ", normals, " normals; at most ",
          kMostTrainedNormals, " are read.");
}

}  // namespace bigus
