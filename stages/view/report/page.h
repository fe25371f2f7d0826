// stages/view/report/page.h: the page of a report, put together.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/data/buffer.h"

namespace lamina::view::report {

/// A piece of data that the page's script unpacks when it is shown.
struct PageData {
  std::string id;
  Buffer<std::byte> deflated;
};

/// The texts of report.html, report.css and report.js, which are part of the program (cmake/report.cmake).
struct PageTexts {
  std::string_view html, css, js;
};
const PageTexts& page_texts();

/// One HTML file that needs no other one. `head` is JSON; nothing in it can end its script element.
std::string make_page(std::string_view title, std::string_view head, const std::vector<PageData>& data);

}  // namespace lamina::view::report
