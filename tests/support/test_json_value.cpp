// The tree of values against the JSON library.
#include "stages/support/text/json_value.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

namespace lamina {
namespace {

/// The same random tree as a value and as one of the library.
void random_trees(std::mt19937& random, int depth, Json& value, nlohmann::ordered_json& tree) {
  const auto below = [&](std::uint32_t count) { return static_cast<std::uint32_t>(random()) % count; };
  switch (below(depth > 3 ? 6 : 8)) {
    case 0: return;
    case 1: value = true, tree = true; return;
    case 2: value = -5, tree = -5; return;
    case 3: value = UINT64_MAX, tree = UINT64_MAX; return;
    case 4: {
      const double number = std::ldexp(static_cast<double>(random()), static_cast<int>(below(80)) - 60);
      value = number, tree = number;
      return;
    }
    case 5: {
      const std::string text(below(5), static_cast<char>(below(256)));
      value = text, tree = text;
      return;
    }
    case 6:
      value = Json::array(), tree = nlohmann::ordered_json::array();
      for (std::uint32_t i = below(4); i > 0; --i) random_trees(random, depth + 1, value.emplace_back(), tree.emplace_back());
      return;
    default:
      value = Json::object(), tree = nlohmann::ordered_json::object();
      for (std::uint32_t i = below(4); i > 0; --i) {
        const std::string name(1, static_cast<char>(97 + below(3)));
        value[name] = {}, tree[name] = {};
        random_trees(random, depth + 1, value[name], tree[name]);
      }
  }
}

TEST(JsonValue, HasTheTextOfTheLibrary) {
  std::mt19937 random(5);
  for (int round = 0; round < 2000; ++round) {
    Json value;
    nlohmann::ordered_json tree;
    random_trees(random, 0, value, tree);
    const std::string text = json_text(value);
    ASSERT_EQ(text, tree.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    EXPECT_EQ(json_text(parse_json(text)), text);
    EXPECT_EQ(json_line(value, 2), tree.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  }
}

TEST(JsonValue, KeepsTheOrderOfItsNames) {
  Json value = {{"z", 1}, {"a", {1, 2.5, "text"}}};
  value["m"] = std::vector<int>{};
  value.update({{"z", nullptr}, {"b", false}});
  EXPECT_EQ(json_text(value), R"({"z":null,"a":[1,2.5,"text"],"m":[],"b":false})");
  value.erase("a");
  EXPECT_EQ(value.find("a"), nullptr);
  EXPECT_EQ(json_text({{"x", std::numeric_limits<double>::infinity()}, {"y", Json::array({1})}}), R"({"x":null,"y":[1]})");
}

TEST(JsonValue, IsReadAsItsKindAlone) {
  const Json value = parse_json(R"({"count": 3, "share": 0.5, "name": "a", "list": [true, false]})");
  EXPECT_EQ(value["count"].get<std::uint32_t>(), 3u);
  EXPECT_EQ(value["count"].get<double>(), 3);
  EXPECT_EQ(value["list"].get<std::vector<bool>>(), (std::vector<bool>{true, false}));
  EXPECT_TRUE(value.has_fraction());
  EXPECT_FALSE(value["count"].has_fraction());
  EXPECT_THROW(value["name"].get<int>(), JsonError);
  EXPECT_THROW(value["count"].text(), JsonError);
  EXPECT_THROW(value["missing"], JsonError);
  EXPECT_THROW(value["list"].at(2), JsonError);
  EXPECT_THROW(parse_json("{"), JsonError);
}

}  // namespace
}  // namespace lamina
