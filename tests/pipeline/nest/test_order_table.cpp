// tests/pipeline/nest/test_order_table.cpp: orders in CSV files, and what is wrong with them.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pipeline/nest/order_table.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

using namespace pipeline;

class OrderTables : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"a.stl", "b.stl"}) write_text(folder_ / name, "part");
  }
  Result<OrderTable> read(const std::string& text) const {
    write_text(folder_ / "orders.csv", text);
    return read_orders(folder_ / "orders.csv");
  }
  /// What is wrong, without the folder.
  std::vector<std::string> faults(const std::string& text) const {
    const auto table = read(text);
    if (!table) return {table.error().message.substr(folder_.path().string().size() + 1)};
    std::vector<std::string> all;
    for (const std::string& fault : table->faults) all.push_back(fault.substr(folder_.path().string().size() + 1));
    return all;
  }
  Directory folder_;
};

TEST_F(OrderTables, HaveColumnsInAnyOrder) {
  const auto table = read(
      "\xef\xbb\xbforder,shelf,file,copies,due,priority,fixed,turns,down,keep_apart_mm,customer,material,group,note\r\n"
      "1001,A3,a.stl,12,2026-12-24,5,10 20.5,0 45,+x,2.5,\"Kunze, GmbH\",steel,g1,\"say \"\"hi\"\"\nto them\"\r\n"
      "\r\n"
      "1002,,b.stl,,,,,any,,,,,,\r\n");
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->faults.size(), 2u) << "12 copies at one position, which is in a group";
  const auto fine = read(
      "file,order,copies,due,fixed,turns,down,customer,shelf\na.stl,1,1,2026-12-24,10 20.5,0 45,+x,\"K, G\",A3\nb.stl,2,7,,,any,,,\n");
  ASSERT_TRUE(fine.ok() && fine->faults.empty()) << fine->faults[0];
  ASSERT_EQ(fine->rows.size(), 2u);
  EXPECT_EQ(date_text(*fine->rows[0].due), "2026-12-24");
  EXPECT_EQ((*fine->rows[0].fixed_mm)[1], 20.5);
  EXPECT_EQ(fine->rows[0].turns, (std::vector<MicroDegrees>{0, 45'000'000}));
  EXPECT_EQ(fine->rows[0].rest_deg, (std::array<double, 2>{0, 90}));
  EXPECT_EQ(fine->rows[0].customer, "K, G");
  EXPECT_EQ(fine->more_columns, std::vector<std::string>{"shelf"});
  EXPECT_EQ(fine->rows[0].more, std::vector<std::string>{"A3"});
  EXPECT_EQ(fine->rows[1].turns.size(), 24u);
  EXPECT_EQ(fine->rows[1].copies, 7u);
  EXPECT_EQ(fine->rows[1].line, 3u);
}

TEST_F(OrderTables, MayHaveSemicolons) {
  const auto table = read("file;copies;note\na.stl;3;one, two\n");
  ASSERT_TRUE(table.ok() && table->faults.empty());
  EXPECT_EQ(table->rows[0].copies, 3u);
  EXPECT_EQ(table->rows[0].note, "one, two");
}

/// A cell of a column, in a row by itself, and how its fault begins.
struct PlantedFault {
  const char *column, *cell, *fault;
};

TEST_F(OrderTables, NameLineAndColumnOfEveryFault) {
  const std::vector<PlantedFault> planted{
      {"copies", "0", "copies: '0' is not a whole number from 1"},
      {"copies", "-3", "copies: '-3'"},
      {"copies", "2.5", "copies: '2.5'"},
      {"copies", "two", "copies: 'two'"},
      {"copies", "1e3", "copies: '1e3'"},
      {"copies", "12x", "copies: '12x'"},
      {"copies", "1000001", "copies: '1000001'"},
      {"copies", "99999999999999999999", "copies: '9"},
      {"copies", "\"1,5\"", "copies: '1,5'"},
      {"due", "24.12.2026", "due: '24.12.2026' is not a date as 2026-12-24"},
      {"due", "2026-13-01", "due: '2026-13-01'"},
      {"due", "2026-02-30", "due: '2026-02-30'"},
      {"due", "2026-1-1", "due: '2026-1-1'"},
      {"due", "12/24/2026", "due: '12/24/2026'"},
      {"due", "tomorrow", "due: 'tomorrow'"},
      {"due", "2026-12-2x", "due: '2026-12-2x'"},
      {"priority", "high", "priority: 'high'"},
      {"priority", "1.5", "priority: '1.5'"},
      {"priority", "5000", "priority: '5000'"},
      {"priority", "\"1,0\"", "priority: '1,0'"},
      {"fixed", "10", "fixed: '10' is not \"X Y\" in mm"},
      {"fixed", "10 20 30", "fixed: '10 20 30'"},
      {"fixed", "\"10,20\"", "fixed: '10,20'"},
      {"fixed", "\"10,5 20\"", "fixed: '10,5' is not a number from 0 to 10000; decimals have a point"},
      {"fixed", "left front", "fixed: 'left'"},
      {"fixed", "-5 0", "fixed: '-5'"},
      {"fixed", "nan 0", "fixed: 'nan'"},
      {"fixed", "20000 0", "fixed: '20000'"},
      {"turns", "0 400", "turns: '400'"},
      {"turns", "-90", "turns: '-90'"},
      {"turns", "\"0,90\"", "turns: '0,90'"},
      {"turns", "all", "turns: 'all' is not a number from 0 to 359.999, nor any"},
      {"turns", "0 \"90", "turns: '\"90'"},
      {"down", "z", "down: 'z' must be one of"},
      {"down", "-w", "down: '-w'"},
      {"down", "top", "down: 'top'"},
      {"down", "-Z", "down: '-Z'"},
      {"keep_apart_mm", "\"2,5\"", "keep_apart_mm: '2,5' is not a number from 0 to 1000; decimals have a point"},
      {"keep_apart_mm", "-1", "keep_apart_mm: '-1'"},
      {"keep_apart_mm", "5mm", "keep_apart_mm: '5mm'"},
      {"keep_apart_mm", "inf", "keep_apart_mm: 'inf'"},
      {"note", "M\xfcller", "is not UTF-8"},
      {"customer", "caf\xe9", "is not UTF-8"}};
  // One table with all of them, one in each row.
  const std::vector<std::string> columns{"file",  "order", "copies",        "due",  "priority", "fixed",
                                         "turns", "down",  "keep_apart_mm", "note", "customer"};
  std::string text = "file,order,copies,due,priority,fixed,turns,down,keep_apart_mm,note,customer\n";
  std::vector<std::string> expected;
  for (std::size_t i = 0; i < planted.size(); ++i) {
    std::size_t column = 1;
    std::string row;
    for (const std::string& name : columns) {
      if (name == planted[i].column)
        expected.push_back("orders.csv:" + std::to_string(i + 2) + ":" + std::to_string(row.size() + 1) + ": " +
                           planted[i].fault);
      row += name == planted[i].column ? planted[i].cell : name == "file" ? "a.stl" : name == "order" ? std::to_string(i) : "";
      if (++column <= columns.size()) row += ",";
    }
    text += row + "\n";
  }
  const std::vector<std::string> found = faults(text);
  ASSERT_EQ(found.size(), planted.size());
  for (std::size_t i = 0; i < planted.size(); ++i)
    EXPECT_TRUE(found[i].starts_with(expected[i])) << found[i] << "\n" << expected[i];
}

TEST_F(OrderTables, NameFaultsOfRowsAndTables) {
  const auto one = [&](const std::string& text, const std::string& expected) {
    const std::vector<std::string> found = faults(text);
    ASSERT_EQ(found.size(), 1u) << text;
    EXPECT_NE(found[0].find(expected), std::string::npos) << found[0];
  };
  one("file\nmissing.stl\n", "orders.csv:2:1: ");
  one("file\nmissing.stl\n", "missing.stl: no such file");
  one("file,copies\n,3\n", "orders.csv:2:1: file: is missing");
  one("part,copies\na.stl,3\n", "orders.csv:1:1: has no column 'file'");
  one("file,copies,copies\na.stl,3,4\n", "orders.csv:1:13: column 'copies' is there twice");
  one("file,copies\na.stl\n", "orders.csv:2:1: the row has 1 cells, the first line 2");
  one("file,copies\na.stl,1,2\n", "orders.csv:2:7: the row has 3 cells");
  one("file,note\na.stl,\"open\n", "orders.csv:2:7: a quote is not closed");
  one("", "is empty");
  one(std::string("\xff\xfe") + std::string("f\0i\0", 4), "is UTF-16");
  one("file,order\na.stl,7\nb.stl,7\na.stl,7\n", "orders.csv:4:7: order '7' has this file in line 2 already");
  one("file,order,priority\na.stl,7,1\nb.stl,7,2\n", "orders.csv:3:9: order '7' has priority 1 in line 2");
  one("file,group,material\na.stl,g,steel\nb.stl,g,bronze\n", "orders.csv:3:7: group 'g' is of material 'steel'");
  one("file,group,priority\na.stl,g,1\nb.stl,g,2\n", "orders.csv:3:9: group 'g' has priority 1 in line 2");
  one("file,group,fixed\na.stl,g,10 10\n", "orders.csv:2:7: is of a part with a position");
  one("file,copy\na.stl,3\n", "orders.csv:1:6: column 'copy': did you mean 'copies'?");
  one("file,Prioritaet\na.stl,3\n", "orders.csv:1:6: column 'Prioritaet': did you mean 'priority'?");
  one("file,orders\na.stl,3\n", "orders.csv:1:6: column 'orders': did you mean 'order'?");
  EXPECT_EQ(faults("File,COPIES,shelf\na.stl,3,A\n"), std::vector<std::string>()) << "capitals are as small letters";
  one("file,fixed,copies\na.stl,10 10,2\n", "orders.csv:2:7: one position is for one copy");
}

}  // namespace
}  // namespace lamina::test
