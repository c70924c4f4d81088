// Whether a test can limit the addresses of a process: the sanitizers of
// addresses and threads reserve terabytes of them.
#ifndef TESTS_SUPPORT_ADDRESS_LIMIT_H_
#define TESTS_SUPPORT_ADDRESS_LIMIT_H_

namespace invgrad {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kCanLimitAddresses = false;
#else
inline constexpr bool kCanLimitAddresses = true;
#endif

}  // namespace invgrad

#endif  // TESTS_SUPPORT_ADDRESS_LIMIT_H_
