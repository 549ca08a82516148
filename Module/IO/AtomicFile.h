// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A file that appears under its name complete or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace bigus
{

/// Writes to a temporary file in the same folder, which Commit() renames. Destroyed without a commit, it removes the
/// temporary file and leaves an earlier file of the final name as it was. Every failure throws FileError.
///
/// The temporary file is made exclusively, with an advisory lock on it. One without a lock was left behind by a program
/// that was killed; the next that writes the same name removes it. An earlier file of the final name passes its
/// permissions on. Where that name is a symbolic link, the file that it leads to is replaced, and the link stays.
class AtomicFile
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

  /// Puts all bytes on the disk and closes the file, so that many files may wait for their commit.
  void Finish();
  /// For files that are replaced together: sets an earlier file of the final name aside. From now on until Keep() the
  /// destructor undoes a commit, too, so all files are again as they were. Where that fails, or the program is killed in
  /// between, the earlier file is TemporaryName() + "-earlier".
  void SetEarlierAside();
  /// Finishes, then gives the file its name, which survives a power cut, too.
  void Commit();
  /// The last of the files that are replaced together has its name.
  void Keep() noexcept;

private:
  bool Open(const std::string& temporaryName);
  [[noreturn]] void Fail(const std::string& what);
  bool RestoreEarlier() noexcept;

  std::string fileName_;  ///< as it was given, for messages
  std::string finalName_;
  std::string temporaryName_;
  std::string earlierName_;  ///< of the earlier file while it is set aside
  std::FILE* file_ = nullptr;
  bool committed_ = false;
  bool isUndone_ = false;    ///< by the destructor
  bool hasEarlier_ = false;  ///< under earlierName_
};

}  // namespace bigus
