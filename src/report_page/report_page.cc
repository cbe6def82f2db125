#include "cairn/report_page/report_page.h"

#include <algorithm>
#include <filesystem>

#include "cairn/base/check.h"
#include "cairn/base/file.h"
#include "report_page/page_files.h"
#include "report_page/page_parts.h"

namespace cairn {
namespace {

// The text with `to` in every place of `from`.
std::string Replaced(std::string_view text, std::string_view from, std::string_view to) {
  std::string replaced;
  for (size_t begin = 0; begin < text.size();) {
    const size_t found = std::min(text.find(from, begin), text.size());
    replaced += text.substr(begin, found - begin);
    if (found < text.size()) replaced += to;
    begin = found + from.size();
  }
  return replaced;
}

// Text as HTML shows it.
std::string EscapedHtml(const std::string& text) {
  return Replaced(Replaced(Replaced(text, "&", "&amp;"), "<", "&lt;"), ">", "&gt;");
}

// What would end the <script> element, or open a comment in it, written otherwise: in JSON, and in
// strings of JavaScript, the result means the same.
std::string DataText(const Json& data) {
  return Replaced(data.dump(-1, ' ', false, Json::error_handler_t::replace), "<", "\\u003c");
}
std::string ScriptText(const std::string& script) {
  return Replaced(Replaced(script, "</", "<\\/"), "<!", "<\\!");
}

// The minified file comes without its licence, which must go along.
constexpr const char* kThreeLicence = R"(<!-- three.js
Copyright (c) 2010-2019 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and
associated documentation files (the "Software"), to deal in the Software without restriction,
including without limitation the rights to use, copy, modify, merge, publish, distribute,
sublicense, and/or sell copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial
portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT
NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES
OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF OR IN
CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE. -->
)";

// three.js with its orbit controls, as two <script> elements; "" where it is not installed.
std::string ThreeScripts(const std::string& folder) {
  std::string scripts = kThreeLicence;
  for (const char* name : {"build/three.min.js", "examples/js/controls/OrbitControls.js"}) {
    const std::string path = folder + "/" + name;
    if (!std::filesystem::exists(path)) return "";
    scripts += "<script>" + ScriptText(ReadFile(path)) + "</script>\n";
  }
  return scripts;
}

// The template with each {{name}} replaced by its text.
std::string FillTemplate(std::string_view page,
                         const std::map<std::string, std::string_view>& texts) {
  std::string filled;
  size_t end = 0;
  for (size_t begin = page.find("{{"); begin != std::string_view::npos;
       begin = page.find("{{", end)) {
    filled += page.substr(end, begin - end);
    end = page.find("}}", begin) + 2;
    filled += texts.at(std::string(page.substr(begin + 2, end - begin - 4)));
  }
  filled += page.substr(end);
  return filled;
}

}  // namespace

ReportPage MakeReportPage(const Database& database, const ReportPageInput& input,
                          const RunContext& run) {
  CAIRN_CHECK_EQ(input.models.size(), input.model_names.size());
  ReportPage page;
  const PageScene scene = MakePageScene(database, input, run);
  PageBlocks blocks;
  const std::string three = ThreeScripts(input.three_folder);
  if (three.empty()) {
    page.warnings.push_back("the report has no 3D view: three.js is not in " + input.three_folder +
                            "; install Debian's libjs-three and run global_sfm report");
  }
  Json data;
  data["title"] = input.title;
  data["three_folder"] = input.three_folder;
  data["findings"] = Findings(scene);
  data["models"] = ModelsJson(scene, blocks);
  data["images"] = ImagesJson(scene, blocks);
  data["cameras"] = CamerasJson(scene, blocks);
  data["pairs"] = PairsJson(scene, blocks);
  data["thumbnails"] = ThumbnailsJson(scene, blocks);
  data["histograms"] = HistogramsJson(scene);
  data["run"] = scene.run_report;
  data["build"] = scene.build_report;
  const int num_absent = data["thumbnails"]["absent"];
  if (num_absent > 0 && !input.image_path.empty()) {
    page.warnings.push_back("the report lacks " + std::to_string(num_absent) + " of " +
                            std::to_string(scene.images.size()) +
                            " photographs, which cannot be read in " + input.image_path);
  }
  const std::string title = EscapedHtml(input.title), json = DataText(data);
  page.html = FillTemplate(kPageHtml, {{"title", title},
                                       {"style", kPageStyle},
                                       {"data", json},
                                       {"blocks", blocks.Html()},
                                       {"three", three},
                                       {"script", kPageScript},
                                       {"view_script", kPageViewScript}});
  return page;
}

}  // namespace cairn
