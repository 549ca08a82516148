// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Files.h"

#include <algorithm>
#include <cctype>
#include <deque>
#include <filesystem>
#include <fstream>
#include <locale>

#include "Exit.h"
#include "IO/AtomicFile.h"
#include "IO/FileError.h"

namespace bigus::command
{

namespace
{

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
    std::error_code ignored, closed;
    const std::filesystem::path absolute = std::filesystem::absolute(path, ignored);
    const std::filesystem::path canonical = std::filesystem::weakly_canonical(absolute, closed);
    return closed ? absolute.lexically_normal() : canonical;  // a folder may not be entered
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
  try
  {
    AtomicFile probe(path);
  }
  catch (const FileError& error)
  {
    throw OutputError(error.what());
  }
}

void RequireDistinct(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs)
{
  for (auto output = outputs.begin(); output != outputs.end(); ++output)
  {
    const auto refuse = [&output](const std::string& other, const char* role)
    {
      RequireOutput(output->empty() || other.empty() || !AreSame(*output, other), "Cannot write '", *output,
                    "': it is the same file as '", other, "', which is ", role, ". Give another name.");
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
  WriteTogether({path}, [&write](std::size_t, std::ostream& file) { write(file); });
}

void WriteTogether(const std::vector<std::string>& paths, const std::function<void(std::size_t, std::ostream&)>& write)
{
  try
  {
    std::deque<AtomicFile> files;
    for (std::size_t i = 0; i < paths.size(); ++i)
    {
      RequireWritable(paths[i]);
      AtomicFile& whole = files.emplace_back(paths[i]);
      std::ofstream file(whole.TemporaryName(), std::ios::binary | std::ios::trunc);
      file.imbue(std::locale::classic());
      write(i, file);
      file.close();
      if (!file)
      {
        throw OutputError("Cannot write '" + paths[i] + "': the disk is full or failed.");
      }
      whole.Finish();
    }
    // Of one file a rename is whole in itself. Of several, one that fails undoes those before.
    for (AtomicFile& whole : files)
    {
      if (files.size() > 1)
      {
        whole.SetEarlierAside();
      }
      whole.Commit();
    }
    for (AtomicFile& whole : files)
    {
      whole.Keep();
    }
  }
  catch (const FileError& error)
  {
    throw OutputError(error.what());
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
