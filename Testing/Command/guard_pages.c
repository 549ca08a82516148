// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// An allocator to preload: every large block ends where a page begins that must not be touched, so that reading one byte
// past the end ends the program. Sanitizers cannot see what an optimiser reads beyond the source's words; this does.
#define _GNU_SOURCE
#include <malloc.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>

extern void* __libc_malloc(size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);
extern void __libc_free(void*);

enum
{
  kLarge = 50000,  // bytes; smaller blocks are left to the C library
  kPage = 4096,
  kMost = 1 << 16,  // large blocks at a time
};

static struct
{
  char *block, *mapped;
  size_t size, length;
} blocks[kMost];
static volatile int locked;

static int find(void* block)
{
  for (int i = 0; i < kMost; ++i)
  {
    if (blocks[i].block == block)
    {
      return i;
    }
  }
  return -1;
}

static void lock(void)
{
  while (__sync_lock_test_and_set(&locked, 1))
  {
  }
}

static void unlock(void)
{
  __sync_lock_release(&locked);
}

static void* large(size_t size)
{
  const size_t length = (size + kPage - 1) / kPage * kPage + kPage;
  char* mapped = mmap(NULL, length, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED)
  {
    return NULL;
  }
  mprotect(mapped + length - kPage, kPage, PROT_NONE);
  lock();
  const int i = find(NULL);
  blocks[i].block = mapped + length - kPage - size;
  blocks[i].mapped = mapped;
  blocks[i].size = size;
  blocks[i].length = length;
  unlock();
  return blocks[i].block;
}

void* malloc(size_t size)
{
  return size < kLarge ? __libc_malloc(size) : large(size);
}

void* calloc(size_t count, size_t size)
{
  void* block = malloc(count * size);
  return block ? memset(block, 0, count * size) : NULL;
}

void free(void* block)
{
  if (!block)
  {
    return;
  }
  lock();
  const int i = find(block);
  if (i >= 0)
  {
    munmap(blocks[i].mapped, blocks[i].length);
    blocks[i].block = NULL;
  }
  unlock();
  if (i < 0)
  {
    __libc_free(block);
  }
}

void* realloc(void* block, size_t size)
{
  lock();
  const int i = block ? find(block) : -1;
  const size_t old = i >= 0 ? blocks[i].size : 0;
  unlock();
  if (i < 0 && size < kLarge)
  {
    return __libc_realloc(block, size);
  }
  void* moved = malloc(size);
  const size_t kept = i >= 0 ? old : block ? malloc_usable_size(block) : 0;
  memcpy(moved, block, kept < size ? kept : size);
  free(block);
  return moved;
}
