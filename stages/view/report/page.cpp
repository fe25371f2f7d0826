#include "stages/view/report/page.h"

#include "stages/support/text/escape.h"

namespace lamina::view::report {
namespace {

std::string escaped(std::string_view text, bool in_json) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += in_json ? "\\u003c" : "&lt;";
    } else if (c == '&' && !in_json) {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

std::string make_page(std::string_view title, std::string_view head, const std::vector<PageData>& data) {
  const PageTexts& texts = page_texts();
  std::string page;
  std::string_view rest = texts.html;
  for (std::size_t at = rest.find("{{"); at != std::string_view::npos; at = rest.find("{{")) {
    page += rest.substr(0, at);
    const std::size_t end = rest.find("}}", at);
    const std::string_view name = rest.substr(at + 2, end - at - 2);
    rest.remove_prefix(end + 2);
    if (name == "title") page += escaped(title, false);
    if (name == "style") page += texts.css;
    if (name == "script") page += texts.js;
    if (name == "head") page += escaped(head, true);
    if (name != "data") continue;
    for (const PageData& piece : data) {
      page += "<script type=\"text/plain\" id=\"" + piece.id + "\">" + base64(piece.deflated) + "</script>\n";
    }
  }
  page += rest;
  return page;
}

}  // namespace lamina::view::report
