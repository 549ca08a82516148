// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// To preload: nothing gets a name that ends as $BROKEN_NAME does, as on a disk that breaks.
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int rename(const char* from, const char* to)
{
  const char* broken = getenv("BROKEN_NAME");
  const size_t length = strlen(to), ending = broken ? strlen(broken) : 0;
  if (broken && length >= ending && strcmp(to + length - ending, broken) == 0)
  {
    errno = EIO;
    return -1;
  }
  return renameat(AT_FDCWD, from, AT_FDCWD, to);
}
