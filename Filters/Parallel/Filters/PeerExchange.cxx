// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "PeerExchange.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <exception>
#include <type_traits>

#include "Core/Model/Error.h"
#include "PartEngine.h"

namespace bigus
{
namespace
{

/// Bytes of an error's words that travel.
constexpr std::size_t kWords = 1024;

/// Bytes of one process that are gathered at once, far below the 2^31 that MPI counts.
constexpr std::size_t kMostGathered = std::size_t(1) << 26;

class Timer
{
public:
  explicit Timer(double& seconds) : seconds_(seconds) {}
  ~Timer() { seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

private:
  double& seconds_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// A tournament: in every round each process has another partner, until all have met. With an odd number of processes one
/// rests, and its partner is the number of processes.
int Rounds(int size)
{
  return size + size % 2 - 1;
}

int Partner(int rank, int round, int size)
{
  const int rounds = Rounds(size), last = rounds;  // the last process stays, and the others turn round it
  if (rank == last)
  {
    return round * ((rounds + 1) / 2) % rounds;
  }
  const int other = (round - rank + rounds) % rounds;
  return other == rank ? last : other;
}

}  // namespace

void PeerExchange::Together(const std::function<void()>& work)
{
  isOver_ = false;
  try
  {
    work();
    Meet(Call::Done, 0, 0);
  }
  catch (const std::exception& error)
  {
    if (!isOver_)
    {
      Tell(error.what());
    }
    throw;
  }
}

std::vector<std::string> PeerExchange::Gather(std::string mine)
{
  const std::vector<Message> messages = Meet(Call::Gather, mine.size(), 0);
  std::uint64_t longest = 0;
  std::vector<std::string> all(messages.size());
  for (std::size_t rank = 0; rank < all.size(); ++rank)
  {
    all[rank].reserve(messages[rank].count);
    longest = std::max(longest, messages[rank].count);
  }
  std::vector<char> part(std::min<std::uint64_t>(kMostGathered, longest)), parts(part.size() * all.size());
  Meet(Call::Gather, mine.size(), 0);  // all have the memory for it
  const Timer timer(sent_.sending);
  for (std::uint64_t from = 0; from < longest; from += kMostGathered)
  {
    const std::size_t bytes = std::min<std::uint64_t>(kMostGathered, longest - from);
    if (from < mine.size())
    {
      std::memcpy(part.data(), mine.data() + from, std::min<std::size_t>(bytes, mine.size() - from));
    }
    GatherToAll(part.data(), bytes, parts.data());
    sent_.bytes += bytes * (all.size() - 1);
    for (std::size_t rank = 0; rank < all.size(); ++rank)
    {
      const std::uint64_t count = messages[rank].count;
      all[rank].append(parts.data() + rank * bytes, from < count ? std::min<std::uint64_t>(bytes, count - from) : 0);
    }
  }
  return all;
}

bool PeerExchange::Any(bool here)
{
  const std::vector<Message> messages = Meet(Call::Any, 0, here ? 1 : 0);
  return std::any_of(messages.begin(), messages.end(), [](const Message& message) { return message.value != 0; });
}

double PeerExchange::OfFirst(double here)
{
  return Meet(Call::OfFirst, 0, here)[0].value;
}

std::unique_ptr<Engine> PeerExchange::CreateEngine(const std::string& name)
{
  return CreatePartEngine(name, *this);
}

std::vector<PeerExchange::Message> PeerExchange::Meet(Call call, std::uint64_t count, double value)
{
  const Message mine{call, 0, count, value};
  std::vector<Message> all(static_cast<std::size_t>(Size()));
  {
    const Timer timer(sent_.waiting);
    ++sent_.calls;
    sent_.bytes += sizeof(Message) * (all.size() - 1);
    GatherToAll(reinterpret_cast<const char*>(&mine), sizeof(Message), reinterpret_cast<char*>(all.data()));
  }
  for (std::size_t rank = 0; rank < all.size(); ++rank)
  {
    if (all[rank].call == Call::Failed)
    {
      isOver_ = true;
      throw Error("Process " + std::to_string(rank) + " of " + std::to_string(Size()) + ": " + Words("")[rank]);
    }
  }
  const bool isSum = call == Call::SumFloats || call == Call::SumDoubles;
  for (const Message& other : all)
  {
    if (other.call != all[0].call || (isSum && other.count != all[0].count))
    {
      isOver_ = true;
      throw Error(
          "The " + std::to_string(Size()) +
          " processes that have one field together no longer do the same; they need the same input, options and "
          "program.");
    }
  }
  return all;
}

/// Makes the call that the others hear of a failure by, whichever they are in.
void PeerExchange::Tell(const std::string& words)
{
  isOver_ = true;
  try
  {
    const Message mine{Call::Failed};
    std::vector<Message> all(static_cast<std::size_t>(Size()));
    GatherToAll(reinterpret_cast<const char*>(&mine), sizeof(Message), reinterpret_cast<char*>(all.data()));
    Words(words);
  }
  catch (const std::exception&)
  {
    // Also the way to them is broken. What failed first is what to tell.
  }
}

/// What each says.
std::vector<std::string> PeerExchange::Words(const std::string& mine)
{
  char text[kWords] = {};
  mine.copy(text, kWords - 1);
  std::vector<char> texts(kWords * static_cast<std::size_t>(Size()));
  GatherToAll(text, kWords, texts.data());
  std::vector<std::string> words;
  for (std::size_t at = 0; at < texts.size(); at += kWords)
  {
    words.emplace_back(&texts[at]);
  }
  return words;
}

/// Two processes give each other all values at once. More of them share the work: each gets its share of the values from
/// every other, adds it up, and gives the sums to all. So each sends 2 (1 - 1 / Size()) times the values, however many
/// processes there are.
template <class Real>
void PeerExchange::SumOf(Real* values, std::size_t count)
{
  const auto size = static_cast<std::size_t>(Size()), rank = static_cast<std::size_t>(Rank());
  const std::size_t share = size == 2 ? count : (count + size - 1) / size, bytes = share * sizeof(Real);
  std::vector<Real> mine(size == 2 ? count : share * size), parts(share * size);
  std::copy_n(values, count, mine.begin());
  Meet(std::is_same_v<Real, float> ? Call::SumFloats : Call::SumDoubles, count, 0);  // all have the memory for it
  const Timer timer(sent_.sending);
  if (size == 2)
  {
    GatherToAll(reinterpret_cast<const char*>(mine.data()), bytes, reinterpret_cast<char*>(parts.data()));
  }
  else
  {
    std::copy_n(mine.data() + rank * share, share, parts.data() + rank * share);
    for (int round = 0; round < Rounds(Size()); ++round)
    {
      const int other = Partner(Rank(), round, Size());
      if (other < Size())
      {
        const std::size_t at = static_cast<std::size_t>(other) * share;
        Swap(other, reinterpret_cast<const char*>(mine.data() + at), bytes, reinterpret_cast<char*>(parts.data() + at));
      }
    }
  }
  for (std::size_t other = 1; other < size; ++other)
  {
    for (std::size_t k = 0; k < share; ++k)
    {
      parts[k] += parts[other * share + k];
    }
  }
  if (size != 2)
  {
    GatherToAll(reinterpret_cast<const char*>(parts.data()), bytes, reinterpret_cast<char*>(mine.data()));
  }
  std::copy_n(size == 2 ? parts.begin() : mine.begin(), count, values);
  sent_.bytes += (size == 2 ? 1 : 2 * (size - 1)) * bytes;
}

template void PeerExchange::SumOf(float*, std::size_t);
template void PeerExchange::SumOf(double*, std::size_t);

}  // namespace bigus
