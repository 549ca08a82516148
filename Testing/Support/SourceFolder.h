// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace bigus::test
{

/// The project's root, for tests that read files of the repository.
std::filesystem::path SourceFolder();

}  // namespace bigus::test
