// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Support/SourceFolder.h"

namespace bigus::test
{

std::filesystem::path SourceFolder()
{
  return BIGUS_SOURCE_DIR;
}

}  // namespace bigus::test
