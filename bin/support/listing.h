// The tables of problems, rules and methods as text, and as the Markdown of
// docs/rules.md and docs/problems.md.
#ifndef BIN_SUPPORT_LISTING_H_
#define BIN_SUPPORT_LISTING_H_

#include <string>

namespace invgrad {

std::string Listing();
// The least-squares problems, and the methods that need no network.
std::string EstimateListing();

std::string RulesMarkdown();
std::string ProblemsMarkdown();

}  // namespace invgrad

#endif  // BIN_SUPPORT_LISTING_H_
