// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The index of a field in pieces, beside sound pieces.
#include "Fuzz/Harness.h"
#include "IO/FieldFile.h"

namespace bigus::fuzz
{

void TryInput(const std::string& bytes)
{
  static const bool arePiecesThere = []
  {
    GaussianField field;
    field.Resize(300);
    for (std::size_t i = 0; i < field.Size(); ++i)
    {
      field.means[i] = {0.1 * static_cast<double>(i), 0, 0};
      field.scales[i] = {1, 1, 1};
      field.rotations[i] = {1, 0, 0, 0};
      field.reflectivities[i] = 0.5;
    }
    WriteField({field, {}, {}}, PathOf("field.pvtp"), 2);
    return true;
  }();
  (void)arePiecesThere;
  RunInfo(Write("field.pvtp", bytes));
}

}  // namespace bigus::fuzz
