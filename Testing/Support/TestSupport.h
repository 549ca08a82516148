// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What tests share: where real data lies, and a folder of their own to write in.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "Support/SourceFolder.h"

namespace bigus::test
{

/// Real sweeps: $BIGUS_DATA, else the folder shared/data beside the project.
inline std::filesystem::path DataFolder()
{
  const char* given = std::getenv("BIGUS_DATA");
  return given && *given ? std::filesystem::path(given) : SourceFolder() / ".." / "shared" / "data";
}

/// Small files that belong to the repository: Testing/Data.
inline std::filesystem::path TestDataFolder()
{
  return SourceFolder() / "Testing" / "Data";
}

/// An empty folder for one test, removed with everything in it when the test ends.
class TemporaryFolder
{
public:
  TemporaryFolder()
  {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::temp_directory_path() /
            ("bigus-" + std::to_string(::getpid()) + "-" + (test ? test->name() : "test"));
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& Path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

private:
  std::filesystem::path path_;
};

}  // namespace bigus::test

/// Skips the test, naming the file, when a real data file is not there; else `path` is its name.
#define BIGUS_REQUIRE_DATA(path, name)                                                       \
  const std::string path = (::bigus::test::DataFolder() / (name)).string();                  \
  if (!std::filesystem::exists(path))                                                        \
  {                                                                                          \
    GTEST_SKIP() << "no " << path << " (set BIGUS_DATA to the folder that holds real data)"; \
  }
