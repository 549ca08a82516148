// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "IO/AtomicFile.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "IO/FileError.h"
#include "IO/Text.h"

namespace bigus
{
namespace
{

/// Of the file that is a lock.
constexpr const char* kLock = ".bigus-lock";

/// Of temporary names. No other program's, because a leftover is removed.
constexpr const char* kSuffix = ".bigus-part";

/// What the name of an earlier file that is set aside has besides.
constexpr const char* kEarlier = "-earlier";

/// So many programs may write one name at a time; each has a temporary name of its own.
constexpr int kWriters = 16;

/// Whether `file`, opened under that name, still has it.
bool HasName(int file, const std::string& name)
{
  struct stat opened, named;
  return fstat(file, &opened) == 0 && lstat(name.c_str(), &named) == 0 && opened.st_dev == named.st_dev &&
         opened.st_ino == named.st_ino;
}

/// Removes a temporary file whose writer has ended.
void RemoveLeftover(const std::string& name)
{
  const int file = open(name.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
  if (file < 0)
  {
    return;
  }
  struct stat status;
  if (fstat(file, &status) == 0 && S_ISREG(status.st_mode) && flock(file, LOCK_EX | LOCK_NB) == 0 &&
      HasName(file, name))
  {
    unlink(name.c_str());
  }
  close(file);
}

/// Where a chain of symbolic links ends, whether a file is there or not.
std::string FollowLinks(const std::string& name)
{
  std::error_code fault;
  if (!std::filesystem::is_symlink(name, fault))
  {
    return name;
  }
  const std::filesystem::path target = std::filesystem::weakly_canonical(name, fault);
  if (fault)  // such as a link to itself, which must not be replaced by what is written
  {
    throw FileError(FileFault::CannotOpen,
                    name + ": cannot be written: it is a symbolic link that leads nowhere (" + fault.message() + ")");
  }
  // A link to a file that is not there stays unresolved.
  const std::filesystem::path next = std::filesystem::read_symlink(target, fault);
  return fault ? target.string() : (target.parent_path() / next).string();
}

}  // namespace

FileLock::FileLock(const std::string& fileName, Mode mode) : name_(fileName + kLock)
{
  for (;;)
  {
    file_ = open(name_.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK, 0666);
    if (file_ < 0)
    {
      return;
    }
    isHeld_ =
        flock(file_, LOCK_EX | (mode == Mode::Try ? LOCK_NB : 0)) == 0 || (errno != EWOULDBLOCK && errno != EINTR);
    if (isHeld_ && HasName(file_, name_))
    {
      return;
    }
    close(file_);  // the one who had it has taken the file away
    file_ = -1;
    if (!isHeld_ && mode == Mode::Try)
    {
      return;
    }
  }
}

FileLock::~FileLock()
{
  if (file_ >= 0)
  {
    unlink(name_.c_str());
    close(file_);
  }
}

bool AtomicFile::IsAside(const std::string& fileName)
{
  struct stat status;
  return lstat(fileName.c_str(), &status) != 0 && lstat((fileName + kSuffix + kEarlier).c_str(), &status) == 0;
}

void AtomicFile::PutEarlierBack(const std::vector<std::string>& fileNames)
{
  if (IsAside(fileNames.front()))
  {
    for (auto name = fileNames.rbegin(); name != fileNames.rend(); ++name)
    {
      rename((*name + kSuffix + kEarlier).c_str(), name->c_str());  // what was not set aside yet is as it was
    }
  }
}

AtomicFile::AtomicFile(const std::string& fileName) : fileName_(fileName), finalName_(FollowLinks(fileName))
{
  for (int writer = 0; writer < kWriters && !file_; ++writer)
  {
    const std::string name = finalName_ + kSuffix + (writer ? "-" + std::to_string(writer) : "");
    if (!Open(name) && errno == EEXIST)
    {
      RemoveLeftover(name);
      Open(name);
    }
    if (!file_ && errno != EEXIST)
    {
      break;
    }
  }
  Require(FileFault::CannotOpen, file_, fileName, ": cannot be written: ",
          errno == EEXIST ? "other programs are writing it, or " + finalName_ + kSuffix + " is not theirs"
                          : std::string(std::strerror(errno)) + "; check that the folder exists and can be written to");
  struct stat earlier;
  if (stat(finalName_.c_str(), &earlier) == 0)
  {
    fchmod(fileno(file_), earlier.st_mode & 0777);
  }
}

AtomicFile::~AtomicFile()
{
  if (isUndone_ && !hasEarlier_ && committed_)
  {
    unlink(finalName_.c_str());
  }
  if (isUndone_)
  {
    RestoreEarlier();
  }
  if (!committed_)
  {
    unlink(temporaryName_.c_str());
  }
  if (file_)
  {
    std::fclose(file_);
  }
}

/// Makes the temporary file and locks it; else leaves the reason in errno.
bool AtomicFile::Open(const std::string& temporaryName)
{
  constexpr mode_t kLessTheUsersMask = 0666;
  const int file = open(temporaryName.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, kLessTheUsersMask);
  if (file < 0)
  {
    return false;
  }
  // Between opening and locking, another program may have taken the file for a leftover and removed it.
  const bool locked =
      flock(file, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK;  // some network folders have no locks
  if (!locked || !HasName(file, temporaryName))
  {
    close(file);
    errno = EEXIST;
    return false;
  }
  file_ = fdopen(file, "wb");
  if (!file_)
  {
    unlink(temporaryName.c_str());
    close(file);
    return false;
  }
  temporaryName_ = temporaryName;
  return true;
}

void AtomicFile::Fail(const std::string& what)
{
  throw FileError(FileFault::DiskFull, fileName_ + ": " + what + ": " + std::strerror(errno) + "; nothing was written");
}

void AtomicFile::Write(const void* bytes, std::size_t count)
{
  if (count > 0 && std::fwrite(bytes, 1, count, file_) != count)
  {
    Fail("writing failed");
  }
}

std::uint64_t AtomicFile::Position()
{
  const long position = std::ftell(file_);
  if (position < 0)
  {
    Fail("writing failed");
  }
  return static_cast<std::uint64_t>(position);
}

void AtomicFile::Seek(std::uint64_t position)
{
  if (std::fseek(file_, static_cast<long>(position), SEEK_SET) != 0)
  {
    Fail("writing failed");
  }
}

void AtomicFile::Finish()
{
  if (!file_)
  {
    return;
  }
  // Some file systems cannot be told to write; they say EINVAL.
  if (std::fflush(file_) != 0 || (fsync(fileno(file_)) != 0 && errno != EINVAL))
  {
    Fail("writing failed");
  }
  std::FILE* file = file_;
  file_ = nullptr;
  if (std::fclose(file) != 0)
  {
    Fail("writing failed");
  }
}

void AtomicFile::SetEarlierAside()
{
  earlierName_ = temporaryName_ + kEarlier;
  hasEarlier_ = rename(finalName_.c_str(), earlierName_.c_str()) == 0;
  Require(FileFault::CannotOpen, hasEarlier_ || errno == ENOENT, fileName_,
          ": cannot be replaced: ", std::strerror(errno), "; nothing was written");
  isUndone_ = true;
}

/// Gives the earlier file, if there was one, its name back. False where that fails.
bool AtomicFile::RestoreEarlier() noexcept
{
  hasEarlier_ = hasEarlier_ && rename(earlierName_.c_str(), finalName_.c_str()) != 0;
  return !hasEarlier_;
}

void AtomicFile::Commit()
{
  Finish();
  std::error_code error;
  std::filesystem::rename(temporaryName_, finalName_, error);
  if (error)
  {
    const std::string left = RestoreEarlier() ? "nothing was written"
                                              : "the earlier file could not be put back either, and is " + earlierName_;
    throw FileError(FileFault::CannotOpen, fileName_ + ": cannot be written: " + error.message() + "; " + left);
  }
  committed_ = true;
  // The new name reaches the disk with its folder. Where a folder cannot be opened for that, the file is there all the same.
  const int folder = open(FolderOf(finalName_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder >= 0)
  {
    fsync(folder);
    close(folder);
  }
}

void AtomicFile::Keep() noexcept
{
  isUndone_ = false;
  unlink(earlierName_.c_str());
}

}  // namespace bigus
