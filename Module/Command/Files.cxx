// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Files.h"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <locale>

#include "Exit.h"

namespace bigus::command
{

namespace
{

/// A name in the same folder that nobody else uses; renaming within a folder replaces a file in one step.
std::string TemporaryPath(const std::string& path)
{
  return path + "." + std::to_string(getpid()) + ".part";
}

/// Whether both paths lead to one file, be it there already or not.
bool AreSame(const std::string& a, const std::string& b)
{
  std::error_code fault;
  if (std::filesystem::equivalent(a, b, fault))
  {
    return true;
  }
  const auto whole = [](const std::string& path)
  {
    std::error_code ignored;
    return std::filesystem::weakly_canonical(std::filesystem::absolute(path, ignored), ignored);
  };
  return whole(a) == whole(b);
}

}  // namespace

bool HasSuffix(const std::string& path, const std::string& suffix)
{
  return path.size() >= suffix.size() &&
         std::equal(suffix.rbegin(), suffix.rend(), path.rbegin(),
                    [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); });
}

void RequireWritable(const std::string& path)
{
  std::error_code ignored;
  if (path.empty() || (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored)))
  {
    throw OutputError("Cannot write '" + path + "': it is not a plain file but a folder or a device.");
  }
  const std::string temporary = TemporaryPath(path);
  errno = 0;
  const bool made = std::ofstream(temporary, std::ios::binary).is_open();
  const int reason = errno;
  std::filesystem::remove(temporary, ignored);
  if (!made)
  {
    throw OutputError("Cannot write '" + path + "': " + std::strerror(reason) +
                      ". Check that its folder exists and may be written to.");
  }
}

void RequireDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs)
{
  for (auto output = outputs.begin(); output != outputs.end(); ++output)
  {
    const auto refuse = [&output](const std::string& other, const char* role)
    {
      if (!output->empty() && !other.empty() && AreSame(*output, other))
      {
        throw OutputError("Cannot write '" + *output + "': it is the same file as '" + other + "', which is " + role +
                          ". Give another name.");
      }
    };
    for (const std::string& input : inputs)
    {
      refuse(input, "read");
    }
    for (auto other = outputs.begin(); other != output; ++other)
    {
      refuse(*other, "written, too");
    }
  }
}

void WriteAtomically(const std::string& path, const std::function<void(std::ostream&)>& write)
{
  RequireWritable(path);
  const std::string temporary = TemporaryPath(path);
  std::error_code fault;
  try
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file.imbue(std::locale::classic());
    write(file);
    file.close();
    if (!file)
    {
      throw OutputError("Cannot write '" + path + "': the disk is full or failed.");
    }
    std::filesystem::rename(temporary, path, fault);
    if (fault)
    {
      throw OutputError("Cannot write '" + path + "': " + fault.message() + ".");
    }
  }
  catch (...)
  {
    std::filesystem::remove(temporary, fault);
    throw;
  }
}

std::string NumberedPath(const std::string& path, int number, int count)
{
  std::string digits = std::to_string(number);
  const std::size_t width = std::max<std::size_t>(std::to_string(std::max(count - 1, 0)).size(), 3);
  digits.insert(0, width > digits.size() ? width - digits.size() : 0, '0');
  const std::filesystem::path whole(path);
  return (whole.parent_path() / (whole.stem().string() + "_" + digits + whole.extension().string())).string();
}

}  // namespace bigus::command
