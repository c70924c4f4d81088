// Compares JSON with the members that docs/json.md lists.
#ifndef INVGRAD_TESTS_SUPPORT_JSON_PAGE_H_
#define INVGRAD_TESTS_SUPPORT_JSON_PAGE_H_

#include <fstream>
#include <map>
#include <set>
#include <string>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/support/source_tree.h"

namespace invgrad {

using JsonMembers = std::map<std::string, std::string>;  // path -> type

// The table of a schema's section. "array of number" is two members, a and a[].
inline JsonMembers MembersOnPage(const std::string& schema) {
  std::ifstream page(SourceDir() + "/docs/json.md");
  JsonMembers members;
  bool is_in_section = false;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("## ", 0) == 0) {
      is_in_section = line == "## `" + schema + "`";
    } else if (is_in_section && line.rfind("| `", 0) == 0) {
      const std::size_t end = line.find("` | ");
      const std::size_t begin = end + 4;
      std::string member = line.substr(3, end - 3);
      std::string type = line.substr(begin, line.find(" |", begin) - begin);
      for (const std::string of = "array of "; type.rfind(of, 0) == 0;) {
        members[member] = "array";
        member += "[]";
        type = type.substr(of.size());
      }
      members[member] = type;
    }
  }
  if (!members.empty()) {
    members["schema.name"] = "text";
    members["schema.version"] = "integer";
  }
  return members;
}

inline bool HasType(const nlohmann::json& json, const std::string& type) {
  if (type == "number") return json.is_number() || json.is_null();
  if (type == "integer") return json.is_number_integer();
  if (type == "boolean") return json.is_boolean();
  if (type == "text") return json.is_string();
  if (type == "array") return json.is_array();
  if (type == "object") return json.is_object();
  if (type == "object or null") return json.is_object() || json.is_null();
  return false;
}

void ExpectOnPage(const nlohmann::json& json, std::set<std::string>* found);

// Members of an object, elements of an array; objects with a schema of their
// own belong to another section.
inline void ExpectPartsOnPage(const nlohmann::json& json,
                              const std::string& path,
                              const JsonMembers& page,
                              const std::string& schema,
                              std::set<std::string>* found) {
  if (json.is_object() && !path.empty() && json.contains("schema")) {
    ExpectOnPage(json, found);
    return;
  }
  for (const auto& [key, value] : json.items()) {
    const std::string part = json.is_array() ? path + "[]"
                             : path.empty()  ? key
                                             : path + "." + key;
    const bool is_plain_object =
        value.is_object() && !value.contains("schema") && page.count(part) == 0;
    if (!is_plain_object) {
      const auto member = page.find(part);
      if (member == page.end()) {
        ADD_FAILURE() << schema << ": " << part << " is not in docs/json.md";
        continue;
      }
      EXPECT_TRUE(HasType(value, member->second))
          << schema << ": " << part << " is no " << member->second << ": "
          << value;
      found->insert(schema + ": " + part);
    }
    if (value.is_structured()) {
      ExpectPartsOnPage(value, part, page, schema, found);
    }
  }
}

// All members of `json` are on the page, with their types. Adds
// "schema: member" to `found`.
inline void ExpectOnPage(const nlohmann::json& json,
                         std::set<std::string>* found) {
  const std::string schema = json.at("schema").at("name");
  EXPECT_EQ(json.at("schema").at("version"), 1);
  ExpectPartsOnPage(json, "", MembersOnPage(schema), schema, found);
}

// Every member on the page was found.
inline void ExpectAllFound(const std::string& schema,
                           const std::set<std::string>& found) {
  const JsonMembers page = MembersOnPage(schema);
  EXPECT_FALSE(page.empty()) << schema << " has no section in docs/json.md";
  for (const auto& [member, type] : page) {
    EXPECT_EQ(found.count(schema + ": " + member), 1u)
        << schema << " has no " << member << ", which docs/json.md lists";
  }
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_JSON_PAGE_H_
