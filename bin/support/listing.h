// The tables of problems and rules as text, and as the Markdown of
// docs/problems.md and docs/rules.md.
#ifndef BIN_SUPPORT_LISTING_H_
#define BIN_SUPPORT_LISTING_H_

#include <ostream>

namespace invgrad {

void PrintListing(std::ostream& out);

// The parts of the table that also apply to problems without a chain.
void PrintRuleListing(std::ostream& out);
void PrintCeresListing(std::ostream& out);

void PrintRulesMarkdown(std::ostream& out);
void PrintProblemsMarkdown(std::ostream& out);

}  // namespace invgrad

#endif  // BIN_SUPPORT_LISTING_H_
