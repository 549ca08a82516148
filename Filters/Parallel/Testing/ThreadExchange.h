// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Threads of one process that stand for processes which train together.
#pragma once

#include <condition_variable>
#include <cstring>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "PeerExchange.h"

namespace bigus::test
{

class ThreadExchange : public PeerExchange
{
public:
  /// What the threads have in common.
  struct Room
  {
    explicit Room(int size) : given(static_cast<std::size_t>(size)) {}

    void Wait()
    {
      std::unique_lock<std::mutex> lock(mutex);
      const int round = rounds;
      if (++waiting == static_cast<int>(given.size()))
      {
        waiting = 0;
        ++rounds;
        everyone.notify_all();
        return;
      }
      everyone.wait(lock, [&] { return rounds != round; });
    }

    std::vector<const char*> given;                                   // by rank
    std::map<std::pair<int, int>, std::deque<std::string>> messages;  // from one to another
    std::mutex mutex;
    std::condition_variable everyone;
    int waiting = 0, rounds = 0;
  };

  ThreadExchange(Room& room, int rank) : room_(room), rank_(rank) {}
  int Rank() const override { return rank_; }
  int Size() const override { return static_cast<int>(room_.given.size()); }

protected:
  void GatherToAll(const char* mine, std::size_t bytes, char* all) override
  {
    room_.given[static_cast<std::size_t>(rank_)] = mine;
    room_.Wait();
    for (std::size_t rank = 0; bytes > 0 && rank < room_.given.size(); ++rank)
    {
      std::memcpy(all + rank * bytes, room_.given[rank], bytes);
    }
    room_.Wait();
  }

  void Swap(int other, const char* mine, std::size_t bytes, char* theirs) override
  {
    std::unique_lock<std::mutex> lock(room_.mutex);
    room_.messages[{rank_, other}].emplace_back(mine, bytes);
    room_.everyone.notify_all();
    std::deque<std::string>& arriving = room_.messages[{other, rank_}];
    room_.everyone.wait(lock, [&] { return !arriving.empty(); });
    arriving.front().copy(theirs, bytes);
    arriving.pop_front();
  }

private:
  Room& room_;
  int rank_;
};

/// Does the work in so many threads, together. Returns what each of them threw, "" where nothing.
inline std::vector<std::string> InThreads(int size, const std::function<void(Exchange&)>& work)
{
  ThreadExchange::Room room(size);
  std::vector<std::string> errors(static_cast<std::size_t>(size));
  std::vector<std::thread> threads;
  for (int rank = 0; rank < size; ++rank)
  {
    threads.emplace_back(
        [&, rank]
        {
          ThreadExchange exchange(room, rank);
          try
          {
            exchange.Together([&] { work(exchange); });
          }
          catch (const std::exception& error)
          {
            errors[static_cast<std::size_t>(rank)] = error.what();
          }
        });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  return errors;
}

}  // namespace bigus::test
