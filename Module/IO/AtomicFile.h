// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A file that appears under its name complete or not at all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

namespace bigus
{

/// Says to other programs, and to other threads of this one, that a name is being written. The lock is a file beside it,
/// which goes away with this object; one that a killed program left is no lock. Where none can be made (a folder that may not
/// be written to, a file system without locks) every lock is had.
class FileLock
{
public:
  enum class Mode
  {
    Try,
    Wait
  };
  FileLock(const std::string& fileName, Mode mode);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  /// False where another has it, which Mode::Wait never sees.
  bool IsHeld() const { return isHeld_; }
  const std::string& Name() const { return name_; }

private:
  std::string name_;
  int file_ = -1;
  bool isHeld_ = true;
};

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
  /// between, the earlier file is TemporaryName() + "-earlier"; see PutEarlierBack().
  void SetEarlierAside();
  /// Finishes, then gives the file its name, which survives a power cut, too.
  void Commit();
  /// The last of the files that are replaced together has its name.
  void Keep() noexcept;

  /// For files that are replaced together: where a program was killed amid their commits, gives those that it had set
  /// aside their names back. `fileNames` begins with the one that was set aside first and committed last.
  static void PutEarlierBack(const std::vector<std::string>& fileNames);
  /// Whether a file has no other name than the one under which it was set aside.
  static bool IsAside(const std::string& fileName);

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
