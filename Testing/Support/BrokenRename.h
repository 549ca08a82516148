// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Renames that fail on demand, as on a disk that breaks. It takes the place of the C library's rename, which
// std::filesystem::rename calls, so that one source of an executable may include it.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <string>
#include <utility>

namespace bigus::test
{

/// While one lives, so many times nothing of this process gets a name that ends so.
class BrokenRename
{
public:
  BrokenRename(std::string ending, int times) { Fault() = {std::move(ending), times}; }
  ~BrokenRename() { Fault() = {}; }
  BrokenRename(const BrokenRename&) = delete;
  BrokenRename& operator=(const BrokenRename&) = delete;

  static bool Fails(const std::string& name)
  {
    auto& [ending, times] = Fault();
    return name.size() >= ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0 &&
           times-- > 0;
  }

private:
  static std::pair<std::string, int>& Fault()
  {
    static std::pair<std::string, int> fault;
    return fault;
  }
};

}  // namespace bigus::test

extern "C" __attribute__((visibility("default"))) int rename(const char* from, const char* to) noexcept
{
  if (bigus::test::BrokenRename::Fails(to))
  {
    errno = EIO;
    return -1;
  }
  return renameat(AT_FDCWD, from, AT_FDCWD, to);
}
