#include "report/interrupt.h"

#include <csignal>
#include <cstdlib>

#include "gtest/gtest.h"

namespace invgrad {
namespace interrupt_test {

int num_calls = 0;
void CountCalls(int) { ++num_calls; }

TEST(Interrupt, TheFirstSignalOnlySetsTheFlag) {
  for (const int signal_number : {SIGINT, SIGTERM, SIGHUP}) {
    const Interrupt interrupt;
    EXPECT_FALSE(Interrupt::IsRequested());
    testing::internal::CaptureStderr();
    std::raise(signal_number);
    EXPECT_EQ(testing::internal::GetCapturedStderr(),
              "\nending after the current step; a second signal ends at once, "
              "without tables\n");
    EXPECT_EQ(Interrupt::Signal(), signal_number);
  }
  EXPECT_TRUE(Interrupt::IsRequested());  // also after its end
  const Interrupt next;
  EXPECT_FALSE(Interrupt::IsRequested());
}

TEST(Interrupt, MayBeSilent) {
  const Interrupt interrupt(/*is_silent=*/true);
  testing::internal::CaptureStderr();
  std::raise(SIGTERM);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_TRUE(Interrupt::IsRequested());
}

TEST(InterruptDeathTest, TheSecondSignalEndsTheProcess) {
  for (const int first : {SIGINT, SIGTERM, SIGHUP}) {
    for (const int second : {SIGINT, SIGTERM, SIGHUP}) {
      EXPECT_EXIT(
          {
            const Interrupt interrupt;
            std::raise(first);
            if (!Interrupt::IsRequested()) {
              std::exit(1);
            }
            std::raise(second);
            std::exit(2);
          },
          testing::KilledBySignal(second),
          "");
    }
  }
}

TEST(Interrupt, RestoresTheHandlersBefore) {
  const auto before = std::signal(SIGINT, CountCalls);
  num_calls = 0;
  {
    const Interrupt interrupt;
    std::raise(SIGINT);
    EXPECT_EQ(num_calls, 0);
  }
  std::raise(SIGINT);
  EXPECT_EQ(num_calls, 1);
  std::signal(SIGINT, before);
}

TEST(Interrupt, IgnoredSignalsStayIgnored) {
  const auto before = std::signal(SIGINT, SIG_IGN);
  {
    const Interrupt interrupt;
    std::raise(SIGINT);
    EXPECT_FALSE(Interrupt::IsRequested());
    std::raise(SIGTERM);
    EXPECT_TRUE(Interrupt::IsRequested());
    std::raise(SIGINT);  // would end the test were it not ignored any more
  }
  std::signal(SIGINT, before);
}

TEST(InterruptDeathTest, OnlyOneAtATime) {
  const Interrupt interrupt;
  EXPECT_DEATH({ const Interrupt second; }, "there is an Interrupt already");
}

}  // namespace interrupt_test
}  // namespace invgrad
