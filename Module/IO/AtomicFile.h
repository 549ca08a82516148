// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A file that appears under its name complete or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "vtkBigusIOModule.h"

namespace bigus
{

/// Writes to a temporary name in the same folder; Commit() renames it. Destroyed without a commit, it removes
/// the temporary file and leaves an earlier file of the final name as it was. Every failure throws FileError.
class VTKBIGUSIO_EXPORT AtomicFile
{
public:
  explicit AtomicFile(const std::string& fileName);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// For a writer that opens the file by name: write there, then call Commit().
  const std::string& TemporaryName() const { return temporaryName_; }

  void Write(const void* bytes, std::size_t count);
  void Write(std::string_view text) { Write(text.data(), text.size()); }
  std::uint64_t Position();
  void Seek(std::uint64_t position);

  void Commit();

private:
  void Close();
  [[noreturn]] void Fail(const std::string& what);

  std::string fileName_;
  std::string temporaryName_;
  std::FILE* file_ = nullptr;
  bool committed_ = false;
};

}  // namespace bigus
