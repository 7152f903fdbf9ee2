/* The bytes of view_assets.c's files; the build says where the plotting library lies. */
        .macro  asset name, file
        .globl  view_asset_\name
        .globl  view_asset_\name\()_end
view_asset_\name:
        .incbin "\file"
view_asset_\name\()_end:
        .byte   0
        .endm

        .section .rodata
        asset   index_html, "host/view/page/index.html"
        asset   view_css, "host/view/page/view.css"
        asset   view_js, "host/view/page/view.js"
        asset   module_js, "host/view/page/module.js"
        asset   uplot_js, UPLOT_JS
        asset   uplot_css, UPLOT_CSS

        .section .note.GNU-stack, "", %progbits
