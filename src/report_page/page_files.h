#pragma once

#include <string_view>

namespace cairn {

// The files of page/, put into the program when it is built (scripts/cmake/EmbedFiles.cmake).
extern const std::string_view kPageHtml;        // page.html, with {{places}} for the others
extern const std::string_view kPageStyle;       // page.css
extern const std::string_view kPageScript;      // page.js
extern const std::string_view kPageViewScript;  // view.js, the 3D view

}  // namespace cairn
