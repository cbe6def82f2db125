# cmake -DOUTPUT=page_files.cc -DHEADER=report_page/page_files.h -DFILES=kName=path;... -P EmbedFiles.cmake
# Writes a source file with each file's content as a std::string_view of the namespace cairn.
set(code "#include \"${HEADER}\"\n\nnamespace cairn {\n")
foreach(item ${FILES})
  string(REGEX MATCH "^([^=]+)=(.*)$" item "${item}")
  set(name ${CMAKE_MATCH_1})
  file(READ "${CMAKE_MATCH_2}" content)
  if(content MATCHES "\\)embedded\"")
    message(FATAL_ERROR "${CMAKE_MATCH_2} has the text that ends a raw string")
  endif()
  string(APPEND code "\nconst std::string_view ${name} = R\"embedded(${content})embedded\";\n")
endforeach()
file(WRITE "${OUTPUT}" "${code}\n}  // namespace cairn\n")
