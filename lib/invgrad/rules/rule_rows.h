// The rows of the library's rules, which rules.cc joins to the table.
#ifndef INVGRAD_RULES_RULE_ROWS_H_
#define INVGRAD_RULES_RULE_ROWS_H_

#include <vector>

#include "invgrad/rules.h"

namespace invgrad {

std::vector<RuleRow> FirstOrderRuleRows();   // first_order_rules.cc
std::vector<RuleRow> NewtonRuleRows();       // newton.cc
std::vector<RuleRow> SpectralRuleRows();     // spectral_rule.cc
std::vector<RuleRow> KfacRuleRows();         // kfac_rule.cc
std::vector<RuleRow> KrylovRuleRows();       // krylov_rule.cc
std::vector<RuleRow> HessianFreeRuleRows();  // hessian_free_rule.cc
std::vector<RuleRow> AdaHessianRuleRows();   // adahessian_rule.cc
std::vector<RuleRow> GeodesicRuleRows();     // geodesic_rule.cc
std::vector<RuleRow> DeterminedRuleRows();   // determined_rule.cc
std::vector<RuleRow> SsBroydenRuleRows();    // ssbroyden_rule.cc

}  // namespace invgrad

#endif  // INVGRAD_RULES_RULE_ROWS_H_
