// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is on the disk around a write that succeeds, fails or is killed.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <set>
#include <string>

#include "IO/AtomicFile.h"
#include "IO/FileError.h"
#include "SmallFiles.h"
#include "Support/TestSupport.h"

namespace bigus::test
{
namespace
{

std::set<std::string> NamesIn(const std::filesystem::path& folder)
{
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
  {
    names.insert(entry.path().filename().string());
  }
  return names;
}

void Write(const std::string& name, const std::string& text)
{
  AtomicFile file(name);
  file.Write(text);
  file.Commit();
}

TEST(AtomicFile, OldContentStaysUntilTheCommit)
{
  const TemporaryFolder folder;
  WriteBytes(folder / "a", "old");
  {
    AtomicFile file(folder / "a");
    file.Write("new");
    file.Finish();
    EXPECT_EQ(ReadBytes(folder / "a"), "old");
  }
  EXPECT_EQ(ReadBytes(folder / "a"), "old");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a"}));
  Write(folder / "a", "new");
  EXPECT_EQ(ReadBytes(folder / "a"), "new");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a"}));
}

TEST(AtomicFile, FilesThatAreReplacedTogetherAreUndoneTogether)
{
  const TemporaryFolder folder;
  WriteBytes(folder / "a", "old");
  const auto write = [&](bool isKept)
  {
    AtomicFile replaced(folder / "a"), fresh(folder / "b");
    for (AtomicFile* const file : {&replaced, &fresh})
    {
      file->Write("new");
      file->SetEarlierAside();
      file->Commit();
    }
    EXPECT_EQ(ReadBytes(folder / "a"), "new");
    EXPECT_EQ(ReadBytes(folder / "b"), "new");
    if (isKept)
    {
      replaced.Keep();
      fresh.Keep();
    }
  };
  write(false);
  EXPECT_EQ(ReadBytes(folder / "a"), "old");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a"}));
  {
    AtomicFile file(folder / "a");
    file.Write("new");
    file.SetEarlierAside();  // and something else fails before the commit
    EXPECT_FALSE(std::filesystem::exists(folder / "a"));
  }
  EXPECT_EQ(ReadBytes(folder / "a"), "old");
  WriteBytes(folder / "b.bigus-part-earlier", "of a writer that was killed");
  write(true);
  EXPECT_EQ(ReadBytes(folder / "a"), "new");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a", "b"}));
}

TEST(AtomicFile, PermissionsStay)
{
  const TemporaryFolder folder;
  WriteBytes(folder / "a", "patient");
  ASSERT_EQ(chmod((folder / "a").c_str(), 0640), 0);
  Write(folder / "a", "again");
  struct stat status;
  ASSERT_EQ(stat((folder / "a").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST(AtomicFile, ASymbolicLinkStaysAndLeadsToTheNewContent)
{
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "there");
  for (const char* target : {"there/present", "there/absent"})
  {
    std::filesystem::remove(folder / "link");
    std::filesystem::create_symlink(target, folder / "link");
    if (std::string(target) == "there/present")
    {
      WriteBytes(folder / target, "old");
    }
    Write(folder / "link", "new");
    EXPECT_TRUE(std::filesystem::is_symlink(folder / "link")) << target;
    EXPECT_EQ(ReadBytes(folder / target), "new") << target;
  }
  EXPECT_EQ(NamesIn(folder / "there"), std::set<std::string>({"absent", "present"}));
}

TEST(AtomicFile, WhatAKilledWriterLeftIsRemovedByTheNext)
{
  const TemporaryFolder folder;
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0)
  {
    AtomicFile file(folder / "a");
    file.Write("half");
    (void)!write(ready[1], "x", 1);
    pause();
    _exit(0);
  }
  char byte;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  EXPECT_EQ(NamesIn(folder / "").size(), 1u);
  // Its temporary file is left alone while it lives.
  Write(folder / "a", "meanwhile");
  EXPECT_EQ(NamesIn(folder / "").size(), 2u);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_EQ(NamesIn(folder / "").size(), 2u);
  Write(folder / "a", "whole");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a"}));
  EXPECT_EQ(ReadBytes(folder / "a"), "whole");
  close(ready[0]);
  close(ready[1]);
}

TEST(AtomicFile, TwoWritersOfOneNameDoNotMix)
{
  const TemporaryFolder folder;
  AtomicFile first(folder / "a"), second(folder / "a");
  first.Write("first");
  second.Write("second");
  second.Commit();
  EXPECT_EQ(ReadBytes(folder / "a"), "second");
  first.Commit();
  EXPECT_EQ(ReadBytes(folder / "a"), "first");
  EXPECT_EQ(NamesIn(folder / ""), std::set<std::string>({"a"}));
}

TEST(AtomicFile, ASymbolicLinkUnderTheTemporaryNameIsNotFollowed)
{
  const TemporaryFolder folder;
  WriteBytes(folder / "victim", "precious");
  std::filesystem::create_symlink("victim", folder / "a.bigus-part");
  Write(folder / "a", "new");
  EXPECT_EQ(ReadBytes(folder / "victim"), "precious");
  EXPECT_EQ(ReadBytes(folder / "a"), "new");
}

TEST(AtomicFile, AFullDiskIsAnError)
{
  if (!std::filesystem::exists("/dev/full"))
  {
    GTEST_SKIP() << "there is no /dev/full here";
  }
  const TemporaryFolder folder;
  AtomicFile file(folder / "a");
  const int full = open("/dev/full", O_WRONLY);
  const int own = [&file]  // the descriptor that the file writes to
  {
    for (int descriptor = 3; descriptor < 1024; ++descriptor)
    {
      std::error_code fault;
      if (std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(descriptor), fault) == file.TemporaryName())
      {
        return descriptor;
      }
    }
    return -1;
  }();
  ASSERT_GE(own, 0);
  dup2(full, own);
  close(full);
  EXPECT_THROW(
      {
        file.Write(std::string(100000, 'x'));
        file.Commit();
      },
      FileError);
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

}  // namespace
}  // namespace bigus::test
