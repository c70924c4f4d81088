// An attack: random cases for a number of seconds, each from a seed of its own.
//
//   TEST(KillAttack, ...) {
//     Attack([](Dice* dice) { one case, with EXPECT... });
//   }
//
//   attack_test --seconds=3600 --seed=1
//
// A finding is a failure of the test; it names the case's seed, with which
// --seconds=0 repeats the case alone.
#ifndef INVGRAD_TESTS_ATTACK_ATTACK_H_
#define INVGRAD_TESTS_ATTACK_ATTACK_H_

#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace invgrad {

// The random choices of a case.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : seed_(seed), random_(seed) {}

  // Counts the cases: the next one has the next number.
  std::uint64_t seed() const { return seed_; }

  // In [0, count).
  int Below(int count) {
    return static_cast<int>(random_() % static_cast<std::uint64_t>(count));
  }
  bool OneIn(int count) { return Below(count) == 0; }
  // In [0, 1).
  double Fraction() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  template <typename T>
  const T& Pick(const std::vector<T>& items) {
    return items[Below(static_cast<int>(items.size()))];
  }

 private:
  const std::uint64_t seed_;
  std::mt19937_64 random_;
};

// Runs cases until --seconds are over or several have failed, at least one.
void Attack(const std::function<void(Dice* dice)>& attack_case);

// Counts what the current attack has done; printed at its end.
void Count(const std::string& what);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ATTACK_ATTACK_H_
