// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What processes that train together tell each other: the same bits for all, and nobody waits for one that failed.
#include <gtest/gtest.h>

#include <stdexcept>

#include "Core/Model/Error.h"
#include "Support/Random.h"
#include "ThreadExchange.h"

namespace bigus::test
{
namespace
{

const std::vector<std::string> kNoErrors(4);

template <class Real>
std::vector<Real> Numbers(int rank, std::size_t count)
{
  Random random(static_cast<std::uint64_t>(rank) + 5);
  std::vector<Real> numbers(count);
  for (Real& number : numbers)
  {
    number = static_cast<Real>(random.Uniform(-1, 1));
  }
  return numbers;
}

template <class Real>
void ExpectOrderedSums()
{
  for (const int size : {1, 2, 3, 4, 5, 6, 7, 8})
  {
    for (const std::size_t count : {0u, 1u, 2u, 1001u})
    {
      std::vector<Real> truth(count, Real(0));
      for (int rank = 0; rank < size; ++rank)
      {
        const std::vector<Real> numbers = Numbers<Real>(rank, count);
        for (std::size_t k = 0; k < count; ++k)
        {
          truth[k] += numbers[k];
        }
      }
      const auto errors = InThreads(size,
                                    [&](Exchange& exchange)
                                    {
                                      std::vector<Real> numbers = Numbers<Real>(exchange.Rank(), count);
                                      exchange.Sum(numbers.data(), count);
                                      EXPECT_EQ(numbers, truth);
                                    });
      EXPECT_EQ(errors, std::vector<std::string>(static_cast<std::size_t>(size)));
    }
  }
}

TEST(Exchange, SumsInTheOrderOfRanks)
{
  ExpectOrderedSums<float>();
  ExpectOrderedSums<double>();
}

TEST(Exchange, GathersAndAgrees)
{
  const auto errors = InThreads(4,
                                [](Exchange& exchange)
                                {
                                  const int rank = exchange.Rank();
                                  EXPECT_EQ(exchange.Gather(std::string(static_cast<std::size_t>(3 * rank % 4), 'a')),
                                            (std::vector<std::string>{"", "aaa", "aa", "a"}));
                                  EXPECT_EQ(exchange.Gather(""), std::vector<std::string>(4));
                                  EXPECT_TRUE(exchange.Any(rank == 2));
                                  EXPECT_FALSE(exchange.Any(false));
                                  EXPECT_EQ(exchange.OfFirst(rank + 0.5), 0.5);
                                });
  EXPECT_EQ(errors, kNoErrors);
}

TEST(Exchange, GathersMoreThanMpiCountsAtOnce)
{
  const std::size_t longest = (std::size_t(1) << 26) + 3;  // a piece and three bytes
  const auto errors = InThreads(2,
                                [&](Exchange& exchange)
                                {
                                  const std::string mine(exchange.Rank() == 0 ? longest : 5, 'a' + exchange.Rank());
                                  const auto all = exchange.Gather(mine);
                                  EXPECT_EQ(all[0], std::string(longest, 'a'));
                                  EXPECT_EQ(all[1], "bbbbb");
                                });
  EXPECT_EQ(errors, std::vector<std::string>(2));
}

TEST(Exchange, WhatFailsInOneFailsInAllWhateverTheyWaitFor)
{
  const std::vector<std::function<void(Exchange&)>> calls = {
      [](Exchange& exchange)
      {
        float number = 1;
        exchange.Sum(&number, 1);
      },
      [](Exchange& exchange) { exchange.Gather("some"); }, [](Exchange& exchange) { exchange.Any(false); },
      [](Exchange& exchange) { exchange.OfFirst(1); }, [](Exchange&) {}};
  for (const auto& call : calls)
  {
    for (int failing = 0; failing < 4; ++failing)
    {
      const auto errors = InThreads(4,
                                    [&](Exchange& exchange)
                                    {
                                      exchange.Any(true);
                                      if (exchange.Rank() == failing)
                                      {
                                        throw std::runtime_error("no memory left");
                                      }
                                      call(exchange);
                                    });
      for (int rank = 0; rank < 4; ++rank)
      {
        EXPECT_EQ(errors[static_cast<std::size_t>(rank)],
                  rank == failing ? "no memory left" : "Process " + std::to_string(failing) + " of 4: no memory left");
      }
    }
  }
}

TEST(Exchange, OfSeveralFailuresEachTellsItsOwn)
{
  const auto errors = InThreads(4,
                                [](Exchange& exchange)
                                {
                                  if (exchange.Rank() % 2 == 1)
                                  {
                                    throw Error("failure " + std::to_string(exchange.Rank()));
                                  }
                                  exchange.Any(false);
                                });
  EXPECT_EQ(errors, (std::vector<std::string>{"Process 1 of 4: failure 1", "failure 1", "Process 1 of 4: failure 1",
                                              "failure 3"}));
}

TEST(Exchange, ProcessesThatDoDifferentThingsAreToldSo)
{
  const auto other = [](Exchange& exchange)
  {
    std::vector<float> numbers(7);
    exchange.Rank() == 3 ? exchange.Sum(numbers.data(), 7) : static_cast<void>(exchange.Any(false));
  };
  const auto longer = [](Exchange& exchange)
  {
    std::vector<float> numbers(7);
    exchange.Sum(numbers.data(), exchange.Rank() == 3 ? 7 : 6);
  };
  for (const std::function<void(Exchange&)>& work : {std::function<void(Exchange&)>(other), {longer}})
  {
    for (const std::string& error : InThreads(4, work))
    {
      EXPECT_NE(error.find("no longer do the same"), std::string::npos) << error;
    }
  }
}

// A process alone answers as one of PeerExchange does that has no peer.
TEST(Exchange, AProcessAloneAnswersForItself)
{
  const auto ask = [](Exchange& exchange)
  {
    EXPECT_EQ(exchange.Rank(), 0);
    EXPECT_EQ(exchange.Size(), 1);
    EXPECT_TRUE(exchange.IsAlone());
    exchange.Together(
        [&]
        {
          std::vector<float> numbers = Numbers<float>(3, 7);
          exchange.Sum(numbers.data(), numbers.size());
          EXPECT_EQ(numbers, Numbers<float>(3, 7));
          EXPECT_EQ(exchange.Gather("words"), std::vector<std::string>{"words"});
          EXPECT_TRUE(exchange.Any(true));
          EXPECT_FALSE(exchange.Any(false));
          EXPECT_EQ(exchange.OfFirst(0.1), 0.1);
        });
    EXPECT_THROW(exchange.Together([] { throw Error("unwell"); }), Error);
  };
  ask(Exchange::Alone());
  InThreads(1, ask);
}

}  // namespace
}  // namespace bigus::test
