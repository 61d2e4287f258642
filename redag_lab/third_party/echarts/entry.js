// What the report page uses of ECharts; everything else is left out of the bundle.
import * as echarts from 'echarts/core';
import {BarChart, CustomChart, LineChart} from 'echarts/charts';
import {
  DataZoomComponent, GridComponent, LegendComponent, MarkLineComponent, TooltipComponent,
} from 'echarts/components';
import {CanvasRenderer, SVGRenderer} from 'echarts/renderers';

echarts.use([
  BarChart, CustomChart, LineChart, DataZoomComponent, GridComponent, LegendComponent,
  MarkLineComponent, TooltipComponent, CanvasRenderer, SVGRenderer,
]);

export const {init, version} = echarts;
export const clipRectByRect = echarts.graphic.clipRectByRect;
